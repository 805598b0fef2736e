# shellcheck shell=sh
# Functions of install.sh, rollback.sh, uninstall.sh and the maintainer scripts of the Debian package, which contain this file.
# `me` is the name of the script in messages. A release is a folder with the program and its dependencies; `current` links to one.

root=${PLUMBLINE_ROOT:-${DPKG_ROOT:-}}    # another root directory, to build an image or to test
base=$root/opt/plumbline
releases=$base/releases
settings=$root/etc/plumbline
installed=$settings/plumbline.toml
environment=$root/etc/default/plumbline
data=$root/var/lib/plumbline
package_unit=$root/usr/lib/systemd/system/plumbline.service
started_s=${PLUMBLINE_START_S:-30}    # time in which a gateway that starts well has started

fail() {
    echo "${me:?}: $1" >&2
    exit 2
}

require_root() {
    [ -n "$root" ] || [ "$(id -u)" = 0 ] || fail "must run as root: sudo $0"
}

# switch_to RELEASE: make a release the current one, atomically.
switch_to() {
    ln -sfn "releases/$1" "$base/current.new"
    mv -T "$base/current.new" "$base/current"
}

current_release() {
    if [ -L "$base/current" ]; then basename "$(readlink "$base/current")"; fi
}

# check_settings RELEASE FILE: check a configuration with a release.
check_settings() {
    "$releases/$1/.venv/bin/python" -P -m gateway config check --service "$2" || fail "$2: correct it, and install again; the installed version is unchanged"
}

# has_package: whether the Debian package is installed; it then owns the unit, the udev rules and the command.
has_package() { [ -e "$package_unit" ]; }

has_systemd() { [ -z "$root" ] && [ -d /run/systemd/system ]; }

# put_environment FILE: make the environment of the service where there is none: root alone may change it, because it can name programs
# to load. Until 0.2.0 it was in the folder of the settings, in which the service may write; it stays there for a rollback.
put_environment() {
    [ ! -e "$environment" ] || return 0
    mkdir -p "$(dirname "$environment")"
    former=$settings/service.env
    if [ -f "$former" ] && [ ! -L "$former" ] && [ "$(stat -c %u "$former")" = "$(id -u)" ]; then
        cp "$former" "$environment"
    else
        cp "$1" "$environment"
    fi
    chmod 0644 "$environment"
}

# put_user: make the service's user, its groups and its folders. People who read recordings are in the group plumbline; those who
# command as well in plumbline-command, which owns the token and the PIN. The service alone is in plumbline-settings.
put_user() {
    mkdir -p "$settings" "$data"
    [ -z "$root" ] || return 0
    for group in i2c dialout plumbline-command plumbline-settings; do
        getent group "$group" >/dev/null || groupadd --system "$group"
    done
    id plumbline >/dev/null 2>&1 || useradd --system --user-group --home-dir "$data" --shell /usr/sbin/nologin plumbline
    chown plumbline:plumbline "$data"
    chmod 0750 "$data"
    for secret in "$data/command-token" "$data/page-pin"; do
        if [ -f "$secret" ] && [ ! -L "$secret" ]; then chgrp -h plumbline-command "$secret"; fi
    done
    chown root:plumbline-settings "$settings"    # `plumbline remote config apply` writes there
    chmod 0775 "$settings"
}

# restart: start the current release; false where it does not start in time. Type=notify: started means that it samples.
restart() {
    has_systemd || return 0
    systemctl daemon-reload
    udevadm control --reload 2>/dev/null || true
    timeout "$started_s" systemctl restart plumbline
}

# activate RELEASE: make a release with checked settings the current one and start it; the one before runs again where it fails.
activate() {
    before=$(current_release)
    [ -z "$before" ] || [ "$before" = "$1" ] || echo "$before" >"$base/previous"
    switch_to "$1"
    if ! restart; then
        if [ "${before:-$1}" = "$1" ]; then fail "the gateway does not start; \`plumbline doctor\` says why"; fi
        switch_to "$before"
        restart || true
        fail "the new version does not start, and $before runs again; see: journalctl -u plumbline"
    fi
    remove_old_releases
}

# roll_back: return to the release before, if it accepts the present settings.
roll_back() {
    before=$(cat "$base/previous" 2>/dev/null) || fail "there is no former version to return to"
    [ -d "$releases/$before" ] || fail "$releases/$before: the former version is not there any more"
    [ ! -e "$installed" ] || check_settings "$before" "$installed"
    current_release >"$base/previous.new"
    switch_to "$before"
    mv "$base/previous.new" "$base/previous"
    echo "program    $releases/$before"
}

# remove_old_releases: keep the current release and the one before it. Until 0.1.0 the program was in /opt/plumbline itself.
remove_old_releases() {
    for part in .venv gateway devices config deploy pyproject.toml requirements.lock README.md LICENSE; do
        rm -rf "${base:?}/$part"
    done
    for folder in "$releases"/*/; do
        name=$(basename "$folder")
        [ "$name" = "$(current_release)" ] || [ "$name" = "$(cat "$base/previous" 2>/dev/null)" ] || rm -rf "$folder"
    done
}

# ask_to_delete: whether a person confirms that recordings, calibration records and settings be deleted.
ask_to_delete() {
    printf 'Delete recordings, calibration records and settings in %s and %s? Type DELETE to delete them: ' "$data" "$settings"
    read -r answer || answer=
    [ "$answer" = DELETE ]
}

delete_data() {
    rm -rf "$data" "$settings" "$environment"
    if [ -z "$root" ]; then
        userdel plumbline 2>/dev/null || true
        for group in plumbline-command plumbline-settings; do groupdel "$group" 2>/dev/null || true; done
    fi
    echo "removed, with recordings, calibration records and settings"
}
