"""`plumbline record recover`: a complete recording from an incomplete one."""

import argparse
from pathlib import Path

from gateway.cli.command import command, option
from gateway.cli.terminal.output import output_file
from gateway.errors import WITH_LOSSES


@command(
    "recover",
    "write a complete recording from an incomplete one",
    "Write a complete recording from an incomplete one, beside it as NAME.recovered.mcap unless --out names "
    "another file. Exit code 3: something of it could not be read.",
    "example: plumbline record recover incomplete.mcap",
    option("log", type=Path, metavar="LOG", help=".mcap written by the gateway"),
    option("--out", type=output_file, metavar="FILE", help="the new recording (default: NAME.recovered.mcap)"),
)
def run_recover(arguments: argparse.Namespace) -> int:
    """Recover a recording; return 3 where something of it could not be read."""
    from gateway.recording.format.salvage import describe_losses
    from gateway.recording.segments.copying import NothingRecordedError, recover, recovered_path

    out = arguments.out or recovered_path(arguments.log)
    try:
        recovered = recover(arguments.log, out)
    except NothingRecordedError as nothing:
        print(nothing)
        return 0
    losses = recovered.losses
    print(f"{out}: {', '.join([f'{recovered.messages} messages recovered', *describe_losses(losses)])}")
    return WITH_LOSSES if losses.torn_bytes or losses.damaged_records or losses.unreadable_messages else 0
