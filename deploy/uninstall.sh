#!/bin/sh
# Remove the service that install.sh has installed: sudo deploy/uninstall.sh [--keep-data | --delete-data]
# Recordings, calibration records and settings are deleted only where that is confirmed.
set -eu

me=uninstall.sh
# shellcheck source=deploy/functions.sh
. "$(dirname "$0")/functions.sh"
require_root
has_package && fail "the Debian package plumbline-gateway is installed: apt remove plumbline-gateway"
case "${1:-}" in
--keep-data) delete=no ;;
--delete-data) delete=yes ;;
"")
    [ -t 0 ] || fail "say what becomes of the recordings in $data: --keep-data or --delete-data"
    if ask_to_delete; then delete=yes; else delete=no; fi
    ;;
*) fail "$1: only --keep-data or --delete-data" ;;
esac

if has_systemd; then
    systemctl disable --quiet --now plumbline 2>/dev/null || true
fi
rm -rf "$base" "$root/usr/local/bin/plumbline"
rm -f "$root/etc/systemd/system/plumbline.service" "$root/etc/systemd/system/plumbline-propose".* "$root/etc/udev/rules.d/60-plumbline.rules"
if has_systemd; then systemctl daemon-reload; fi
if [ "$delete" = yes ]; then
    delete_data
else
    echo "removed; recordings and calibration records are in $data, settings in $settings"
fi
