#!/bin/sh
# The command `plumbline` of the installed version.
exec /opt/plumbline/current/.venv/bin/python -P -m gateway "$@"
