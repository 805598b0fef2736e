"""The options `--from` and `--to`, which select an interval of a recording."""

import argparse
from typing import TYPE_CHECKING

from gateway.cli.argument_types import recording_time

if TYPE_CHECKING:
    from gateway.recording.interval import RecordingInterval


def add_interval(command: argparse.ArgumentParser) -> None:
    """Add the options."""
    command.add_argument(
        "--from",
        dest="from_time",
        type=recording_time,
        metavar="T",
        help="begin here: seconds from the start of the recording (30, 1:30), or UTC (2026-11-22T07:30:00Z, or 07:30:05 on "
        "the day of the first sample)",
    )
    command.add_argument(
        "--to", dest="to_time", type=recording_time, metavar="T", help="end before this time, in the same forms"
    )


def interval(arguments: argparse.Namespace) -> "RecordingInterval":
    """Return the interval of the options; without them the whole recording."""
    from gateway.recording.interval import RecordingInterval

    return RecordingInterval(arguments.from_time, arguments.to_time)
