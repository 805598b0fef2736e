"""`plumbline archive upload`: sends finished segments to an archive."""

import argparse
import os
import sys
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero, parsed_by
from gateway.cli.command import command, option
from gateway.errors import ANSWER_IS_NO
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.archive.upload import TimeWindow, Uploader, UploadResult

NICENESS = 15
"""Priority below that of the gateway, whose recording comes first. Basis: as deploy's other helpers; what is idle is used."""
LONGEST_PAUSE_S = 3600.0
"""Longest pause after failures. Basis: a choice; a link that comes back is used within the hour."""


def _window(text: str) -> "TimeWindow":
    from gateway.archive.upload import parse_window

    return parse_window(text)


@command(
    "upload",
    "send finished, signed segments of a data folder to a folder or an object store",
    "Send finished, signed segments of a gateway's data folder to a folder or an S3-compatible store. Names "
    "contain the hash of the content and are written once; what is there is not sent again. Exit code 1: something is left "
    "to send, or differs from what was signed.",
    "example: plumbline archive upload /var/lib/plumbline --to s3://cranes/2026 --credentials s3.toml --every 10",
    option("folder", type=Path, metavar="FOLDER", help="data folder of a gateway; it is only read"),
    option("--to", required=True, metavar="STORE", help="folder, or a URL such as s3://bucket/prefix"),
    option(
        "--credentials",
        type=Path,
        metavar="FILE",
        help="TOML file with the settings of the store, such as aws_access_key_id, that its owner alone may read "
        "(default: the "
        "usual environment of the store)",
    ),
    option("--rate", type=above_zero, metavar="KB_S", help="mean rate, kB/s (default: without limit)"),
    option(
        "--between",
        type=parsed_by(_window),
        metavar="T-T",
        help="time of the day in which to send, local time: 22:00-05:00",
    ),
    option("--every", type=above_zero, metavar="MINUTES", help="go on until Ctrl-C, and look again so often"),
)
def run_upload(arguments: argparse.Namespace) -> int:
    """Send what is there, once or for ever."""
    require_extra("archive")
    from gateway.archive.upload import Uploader, UploadLimits, open_destination
    from gateway.errors import InputError

    if not arguments.folder.is_dir():
        raise InputError(f"{arguments.folder}: is no folder; give the data folder of a gateway")
    os.nice(NICENESS)
    limits = UploadLimits(None if arguments.rate is None else 1e3 * arguments.rate, arguments.between)
    store = open_destination(arguments.to, arguments.credentials)
    uploader = Uploader(arguments.folder, store, limits, lambda: datetime.now().astimezone(), time.sleep)
    if arguments.every is None:
        return _told(uploader.run(print))
    return _go_on(uploader, arguments.between, 60 * arguments.every)


def _go_on(uploader: "Uploader", window: "TimeWindow | None", every_s: float) -> int:
    """Send until Ctrl-C; after failures the pauses double."""
    from gateway.errors import InputError

    failures = 0
    while True:
        try:
            _told(uploader.run(print))
            failures = 0
        except InputError as error:
            failures += 1
            print(f"plumbline archive: {error}", file=sys.stderr)
        pause_s = max(every_s, min(every_s * 2**failures, LONGEST_PAUSE_S)) if failures else every_s
        closed_s = 0.0 if window is None else window.wait_s(datetime.now().astimezone())
        sys.stdout.flush()
        time.sleep(max(pause_s, closed_s))


def _told(result: "UploadResult") -> int:
    for reason in result.refused:
        print(f"plumbline archive: not sent: {reason}", file=sys.stderr)
    print(
        f"{result.sent} segments sent ({result.sent_bytes / 1e6:.1f} MB), {result.present} were there, {result.left} left, "
        f"{result.unfinished} not finished"
    )
    return ANSWER_IS_NO if result.left or result.refused else 0
