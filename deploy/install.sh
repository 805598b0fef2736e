#!/bin/sh
# Install or upgrade Plumbline as a service on a Raspberry Pi (64-bit OS) or any Debian: sudo deploy/install.sh [CONFIG.toml]
# Recordings, calibration records and an existing configuration are kept.
set -eu

root=${PLUMBLINE_ROOT:-}    # another root directory, to build an image or to test the script
program=$root/opt/plumbline
settings=$root/etc/plumbline
data=$root/var/lib/plumbline
units=$root/etc/systemd/system
source=$(cd "$(dirname "$0")/.." && pwd)
config=${1:-$source/config/simulated.toml}

fail() {
    echo "install.sh: $1" >&2
    exit 2
}

[ -n "$root" ] || [ "$(id -u)" = 0 ] || fail "must run as root: sudo $0"
[ -r "$config" ] || fail "$config: no such configuration; config/ has examples"
python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "python3 >= 3.11 is needed (Raspberry Pi OS 12 or later)"
"$python" -c 'import ensurepip, venv' 2>/dev/null || fail "python3-venv is missing: apt install python3-venv"

echo "program    $program"
mkdir -p "$program" "$settings" "$data" "$units"
for part in gateway devices config deploy pyproject.toml requirements.lock README.md LICENSE; do
    rm -rf "${program:?}/$part"
    cp -R "$source/$part" "$program/$part"
done
[ -x "$program/.venv/bin/python" ] || "$python" -m venv "$program/.venv"
"$program/.venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: --require-hashes \
    -r "$program/requirements.lock"
# The distribution's former name: left installed, it would own the same command.
"$program/.venv/bin/python" -m pip uninstall --quiet --quiet --yes plumbline
"$program/.venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps --editable "$program"

echo "settings   $settings/plumbline.toml"
"$program/.venv/bin/plumbline" config check "$config"
[ -e "$settings/plumbline.toml" ] || cp "$config" "$settings/plumbline.toml"
cp "$source/deploy/plumbline.service" "$units/plumbline.service"

if [ -n "$root" ]; then
    echo "another root: create the user, the groups and the service at the image's first start"
    exit 0
fi
for group in i2c dialout; do
    getent group "$group" >/dev/null || groupadd --system "$group"
done
id plumbline >/dev/null 2>&1 || useradd --system --home-dir "$data" --shell /usr/sbin/nologin plumbline
chown plumbline:plumbline "$data"
systemctl daemon-reload
systemctl enable --quiet plumbline
systemctl restart plumbline
echo "service    running; its log: journalctl -u plumbline -f"
echo "page       on this machine: http://127.0.0.1:8321/"
