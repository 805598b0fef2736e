#!/bin/sh
# Install or upgrade Plumbline as a service on a Raspberry Pi (64-bit OS) or any Debian.
#
#     sudo deploy/install.sh CONFIG.toml    install, or upgrade and change the settings
#     sudo deploy/install.sh                upgrade; the installed settings stay
#     sudo deploy/install.sh --rollback     return to the version before
#
# The new version is made and checks the settings while the old one runs. Only then is the service restarted; if the new version
# does not start, the old one is started again. Recordings, calibration records and settings are kept.
set -eu

root=${PLUMBLINE_ROOT:-}    # another root directory, to build an image or to test the script
base=$root/opt/plumbline
releases=$base/releases
settings=$root/etc/plumbline
installed=$settings/plumbline.toml
data=$root/var/lib/plumbline
source=$(cd "$(dirname "$0")/.." && pwd)
python=${PYTHON:-python3}
started_s=30    # time in which a gateway that starts well has started

fail() {
    echo "install.sh: $1" >&2
    exit 2
}

# switch_to NAME: make a release the current one, atomically.
switch_to() {
    ln -sfn "releases/$1" "$base/current.new"
    mv -T "$base/current.new" "$base/current"
}

current_release() {
    if [ -L "$base/current" ]; then basename "$(readlink "$base/current")"; fi
}

check_root_and_python() {
    [ -n "$root" ] || [ "$(id -u)" = 0 ] || fail "must run as root: sudo $0"
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "python3 >= 3.11 is needed (Raspberry Pi OS 12 or later)"
    "$python" -c 'import ensurepip, venv' 2>/dev/null || fail "python3-venv is missing: apt install python3-venv"
}

# make_release NAME: copy the program into its new folder and install its locked dependencies. Leaves nothing behind where it fails.
make_release() {
    folder=$releases/$1
    trap 'rm -rf "$folder"' EXIT
    for part in config deploy requirements.lock README.md LICENSE; do
        cp -R "$source/$part" "$folder/$part"
    done
    "$python" -m venv "$folder/.venv"
    "$folder/.venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: --require-hashes \
        -r "$folder/requirements.lock" || fail "the dependencies could not be installed; the installed version is unchanged"
    "$folder/.venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps "$source" ||
        fail "the program could not be installed; the installed version is unchanged"
}

# check_settings NAME FILE: check a configuration with a release.
check_settings() {
    "$releases/$1/.venv/bin/python" -P -m gateway config check "$2" || fail "$2: correct it, and install again; the installed version is unchanged"
}

# put_settings FILE: put a checked configuration into force; the one before is kept beside it.
put_settings() {
    mkdir -p "$settings"
    if [ -e "$installed" ] && ! cmp -s "$1" "$installed"; then
        kept=$installed.until-$(date -u +%Y%m%dT%H%M%SZ)
        cp -p "$installed" "$kept"
        echo "settings   the former ones are kept: $kept"
    fi
    if ! [ "$1" -ef "$installed" ]; then
        cp "$1" "$installed.new"
        mv "$installed.new" "$installed"
    fi
}

put_service() {
    mkdir -p "$root/etc/systemd/system" "$root/etc/udev/rules.d" "$root/usr/local/bin" "$data"
    cp "$1/deploy/plumbline.service" "$root/etc/systemd/system/plumbline.service"
    cp "$1/deploy/60-plumbline.rules" "$root/etc/udev/rules.d/60-plumbline.rules"
    cp "$1/deploy/service.env" "$settings/service.env"
    cp "$1/deploy/plumbline.sh" "$root/usr/local/bin/plumbline.new"
    chmod 0755 "$root/usr/local/bin/plumbline.new"
    mv "$root/usr/local/bin/plumbline.new" "$root/usr/local/bin/plumbline"
}

put_user() {
    for group in i2c dialout; do
        getent group "$group" >/dev/null || groupadd --system "$group"
    done
    id plumbline >/dev/null 2>&1 || useradd --system --user-group --home-dir "$data" --shell /usr/sbin/nologin plumbline
    chown plumbline:plumbline "$data"
    chmod 0750 "$data"
}

# restart: start the current release; false where it does not start in time. Type=notify: started means that it samples.
restart() {
    systemctl daemon-reload
    udevadm control --reload 2>/dev/null || true
    systemctl enable --quiet plumbline
    timeout "$started_s" systemctl restart plumbline
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

if [ "${1:-}" = --rollback ]; then
    check_root_and_python
    before=$(cat "$base/previous" 2>/dev/null) || fail "there is no former version to return to"
    [ -d "$releases/$before" ] || fail "$releases/$before: the former version is not there any more"
    check_settings "$before" "$installed"
    current_release >"$base/previous.new"
    switch_to "$before"
    mv "$base/previous.new" "$base/previous"
    put_service "$releases/$before"
    echo "program    $releases/$before"
    [ -n "$root" ] || restart || fail "the former version does not start; see: journalctl -u plumbline"
    exit 0
fi

config=${1:-$installed}
[ -e "$config" ] || [ -n "${1:-}" ] ||
    fail "name a configuration: $0 CONFIG.toml; config/ has examples"
[ -r "$config" ] || fail "$config: no such configuration; config/ has examples"
check_root_and_python

version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$source/pyproject.toml")
before=$(current_release)
mkdir -p "$releases"
release=$(basename "$(mktemp -d "$releases/$version-$(date -u +%Y%m%dT%H%M%S)-XXXX")")
chmod 0755 "$releases/$release"
make_release "$release"
check_settings "$release" "$config"
put_settings "$config"
trap - EXIT
[ -z "$before" ] || echo "$before" >"$base/previous"
switch_to "$release"
put_service "$releases/$release"
echo "program    $releases/$release"
echo "settings   $installed"

if [ -n "$root" ]; then
    remove_old_releases
    echo "another root: create the user, the groups and the service at the image's first start"
    exit 0
fi
put_user
if ! restart; then
    [ -n "$before" ] || fail "the gateway does not start; \`plumbline doctor\` says why"
    switch_to "$before"
    restart || true
    fail "the new version does not start, and $before runs again; see: journalctl -u plumbline"
fi
remove_old_releases
echo "service    running; its log: journalctl -u plumbline -f; its state: plumbline doctor"
echo "page       on this machine: http://127.0.0.1:8321/"
echo "recordings $data; to read them without sudo: usermod -aG plumbline USER"
