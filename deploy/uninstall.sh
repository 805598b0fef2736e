#!/bin/sh
# Remove the service: sudo deploy/uninstall.sh [--keep-data | --delete-data]
# Recordings, calibration records and settings are deleted only where that is confirmed.
set -eu

root=${PLUMBLINE_ROOT:-}    # another root directory, to test the script
data=$root/var/lib/plumbline
settings=$root/etc/plumbline

fail() {
    echo "uninstall.sh: $1" >&2
    exit 2
}

[ -n "$root" ] || [ "$(id -u)" = 0 ] || fail "must run as root: sudo $0"
case "${1:-}" in
--keep-data) delete=no ;;
--delete-data) delete=yes ;;
"")
    [ -t 0 ] || fail "say what becomes of the recordings in $data: --keep-data or --delete-data"
    printf 'Delete recordings, calibration records and settings in %s and %s? Type DELETE to delete them: ' "$data" "$settings"
    read -r answer
    if [ "$answer" = DELETE ]; then delete=yes; else delete=no; fi
    ;;
*) fail "$1: only --keep-data or --delete-data" ;;
esac

if [ -z "$root" ]; then
    systemctl disable --quiet --now plumbline 2>/dev/null || true
fi
rm -rf "$root/opt/plumbline" "$root/usr/local/bin/plumbline"
rm -f "$root/etc/systemd/system/plumbline.service" "$root/etc/udev/rules.d/60-plumbline.rules"
[ -n "$root" ] || systemctl daemon-reload
if [ "$delete" = yes ]; then
    rm -rf "$data" "$settings"
    [ -n "$root" ] || userdel plumbline 2>/dev/null || true
    echo "removed, with recordings, calibration records and settings"
else
    echo "removed; recordings and calibration records are in $data, settings in $settings"
fi
