"""The options that commands on recordings share: which recordings, which interval, which time zone, JSON."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.options.argument_types import duration_s, recording_time

if TYPE_CHECKING:
    from gateway.recording.reading.interval import RecordingInterval, RecordingTime


def add_interval(command: argparse.ArgumentParser) -> None:
    """Add the options of the interval."""
    begin = command.add_mutually_exclusive_group()
    begin.add_argument(
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
    begin.add_argument(
        "--last",
        dest="last_s",
        type=duration_s,
        metavar="D",
        help="only the end of the recording, or of what is before --to: seconds (90), minutes (1:30) or hours (1:00:00)",
    )


def add_local(command: argparse.ArgumentParser) -> None:
    """Add the option for times of this computer's time zone."""
    command.add_argument(
        "--local",
        action="store_true",
        help="print times in this computer's time zone in place of UTC, and read those of --from and --to so",
    )


def interval(arguments: argparse.Namespace) -> "RecordingInterval":
    """Return the interval of the options; without them the whole recording."""
    from gateway.recording.reading.interval import RecordingInterval

    is_local = getattr(arguments, "local", False)
    begin, end = (in_zone(time, is_local) for time in (arguments.from_time, arguments.to_time))
    return RecordingInterval(begin, end, last_s=arguments.last_s)


def in_zone(time: "RecordingTime | None", is_local: bool) -> "RecordingTime | None":
    """Return a time of the options, read in this computer's time zone with `--local`."""
    from gateway.recording.reading.interval import parse_recording_time

    return None if time is None else parse_recording_time(time.text, is_local=is_local)


def add_paths(verb: argparse.ArgumentParser) -> None:
    """Add the recordings, as `paths`."""
    verb.add_argument(
        "paths", type=Path, nargs="+", metavar="PATH", help=".mcap files written by the gateway, and folders of them"
    )


def add_selection(verb: argparse.ArgumentParser) -> None:
    """Add the recordings and the interval of them; `gateway.cli.options.recording_options.interval` returns it."""
    add_paths(verb)
    add_interval(verb)
    add_local(verb)
