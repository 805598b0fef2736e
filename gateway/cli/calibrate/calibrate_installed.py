"""`plumbline calibrate installed`: a housing that stays on its rope, from the swings and rests of service."""

import argparse
from pathlib import Path

from gateway.cli.calibrate.calibrate_record import RECORD_OPTIONS, finish_record
from gateway.cli.command import command, option


@command(
    "installed",
    "a housing that stays on its rope, from the free swings and rests of weeks",
    "Compare the record of --parent and the rig with what free swings and rests of weeks of service show: place, scale across "
    "the rope, offset and mount, each with its 95 %% interval by the scatter from day to day, and sums where no swing tells two "
    "apart. Where the data are better than the parent, the result is a new record; nothing uses it until it is put in force. "
    "Exit code 1: the parent or the rig is contradicted, or the recordings do not determine it.",
    "example: plumbline calibrate installed plumbline-data --parent before.json --json offered.json",
    option(
        "paths",
        type=Path,
        nargs="+",
        metavar="RECORDING",
        help=".mcap files of one gateway, and folders of them, of 5 days or more",
    ),
    *RECORD_OPTIONS,
)
def run_installed(arguments: argparse.Namespace) -> int:
    """Compare, and offer a record where it is better; return 1 where parent or rig are contradicted."""
    from gateway.bench.installed.installed_calibration import calibrate_installed, format_installed, read_windows
    from gateway.calibration.input_files import read_record
    from gateway.cli.progress import Progress
    from gateway.errors import InputError

    if arguments.parent is None:
        raise InputError("--parent FILE is needed: the record that was in force while the recordings were made")
    parent = read_record(arguments.parent)
    with Progress() as progress:
        windows, housing, correction = read_windows(
            arguments.paths, parent, lambda share: progress.tick("reading", share)
        )
    found = calibrate_installed(windows, parent, housing, correction)
    arguments.device_id = parent.device_id
    table = format_installed(found, parent.id)
    code = 1 if found.is_contradicted else 0
    if found.offer is None:
        print(table)
        print("no record is offered: the parent is as good or better, or place or rope are contradicted")
        return code
    notes = ("an offer: review it, then put it in force",)
    return max(code, finish_record(arguments, found.offer, parent.unit, notes, parent, preface=table + "\n\n"))
