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

me=install.sh
source=$(cd "$(dirname "$0")/.." && pwd)
# shellcheck source=deploy/functions.sh
. "$source/deploy/functions.sh"
python=${PYTHON:-python3}

check_root_and_python() {
    require_root
    has_package && fail "the Debian package plumbline-gateway is installed; upgrade with it, or remove it first: apt remove plumbline-gateway"
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

# put_settings FILE: put a checked configuration into force; the one before is kept beside it.
put_settings() {
    mkdir -p "$settings"
    if [ -e "$installed" ] && ! cmp -s "$1" "$installed"; then
        kept=$installed.until-$(date -u +%Y%m%dT%H%M%SZ)
        cp -p --remove-destination "$installed" "$kept"
        echo "settings   the former ones are kept: $kept"
    fi
    # The service may write here: a link in place of the new file is not followed.
    cp --remove-destination "$1" "$installed.new"
    mv "$installed.new" "$installed"
}

# put_service RELEASE: put the unit, the udev rules, the environment and the command of a release into their places.
put_service() {
    parts=$releases/$1/deploy
    mkdir -p "$root/etc/systemd/system" "$root/etc/udev/rules.d" "$root/usr/local/bin"
    for unit in "$parts"/plumbline.service "$parts"/plumbline-propose.*; do
        if [ -e "$unit" ]; then cp "$unit" "$root/etc/systemd/system/"; fi    # a former release may not have it
    done
    cp "$parts/60-plumbline.rules" "$root/etc/udev/rules.d/60-plumbline.rules"
    put_environment "$parts/service.env"
    cp "$parts/plumbline.sh" "$root/usr/local/bin/plumbline.new"
    chmod 0755 "$root/usr/local/bin/plumbline.new"
    mv "$root/usr/local/bin/plumbline.new" "$root/usr/local/bin/plumbline"
}

if [ "${1:-}" = --rollback ]; then
    check_root_and_python
    roll_back
    put_service "$(current_release)"
    restart || fail "the former version does not start; see: journalctl -u plumbline"
    exit 0
fi

config=${1:-$installed}
[ -e "$config" ] || [ -n "${1:-}" ] ||
    fail "name a configuration: $0 CONFIG.toml; config/ has examples"
[ -r "$config" ] || fail "$config: no such configuration; config/ has examples"
check_root_and_python

version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$source/pyproject.toml")
mkdir -p "$releases"
release=$(basename "$(mktemp -d "$releases/$version-$(date -u +%Y%m%dT%H%M%S)-XXXX")")
chmod 0755 "$releases/$release"
make_release "$release"
check_settings "$release" "$config"
trap - EXIT
put_settings "$config"
put_user
put_service "$release"
if has_systemd; then systemctl enable --quiet plumbline; fi
activate "$release"
echo "program    $releases/$release"
echo "settings   $installed"
if ! has_systemd; then
    echo "no systemd here: create the user, the groups and the service at the image's first start"
    exit 0
fi
echo "service    running; its log: journalctl -u plumbline -f; its state: plumbline doctor"
echo "page       on this machine: http://127.0.0.1:8321/"
echo "recordings $data; to read them without sudo: usermod -aG plumbline USER"
echo "commands   those who may command as well: usermod -aG plumbline,plumbline-command USER"
