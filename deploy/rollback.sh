#!/bin/sh
# Return to the version before, of the Debian package: sudo /opt/plumbline/current/deploy/rollback.sh
# The former version checks the present settings first. Twice is back again. Recordings and calibration records stay.
set -eu

me=rollback.sh
# shellcheck source=deploy/functions.sh
. "$(dirname "$0")/functions.sh"
require_root
roll_back
restart || fail "the former version does not start; see: journalctl -u plumbline"
