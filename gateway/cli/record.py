"""`plumbline record`: show what is in a recording, and recover an incomplete one."""

import argparse
from pathlib import Path

WITH_LOSSES = 3


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command with its verbs."""
    command = commands.add_parser(
        "record",
        help="show what is in recordings, and recover incomplete ones",
        description="Show what is in recordings, and recover incomplete ones.",
        epilog="example: plumbline record info plumbline-data/*.mcap",
    )
    verbs = command.add_subparsers(dest="verb", metavar="VERB", required=True)
    info = verbs.add_parser(
        "info",
        help="print what is in a recording: times, topics, samples, losses, calibration, alerts",
        description="Print what is in a recording: times, topics, samples, losses, calibration and alerts.",
        epilog="example: plumbline record info plumbline-data/*.mcap --json info.json",
    )
    info.add_argument("logs", type=Path, nargs="+", metavar="LOG", help=".mcap written by the gateway")
    info.add_argument("--json", type=Path, metavar="FILE", help="also write it as JSON")
    info.set_defaults(run=_info)
    recover = verbs.add_parser(
        "recover",
        help="write a complete recording from an incomplete one",
        description="Write a complete recording from an incomplete one. Exit code 3: something of it could not be read.",
        epilog="example: plumbline record recover incomplete.mcap --out complete.mcap",
    )
    recover.add_argument("log", type=Path, metavar="LOG", help=".mcap written by the gateway")
    recover.add_argument("--out", type=Path, metavar="FILE", required=True, help="the new recording")
    recover.set_defaults(run=_recover)


def _info(arguments: argparse.Namespace) -> int:
    from gateway.cli.output import write_json
    from gateway.recording.info import summarise
    from gateway.recording.info_text import info_text

    found = [summarise(path) for path in arguments.logs]
    print("\n\n".join(info_text(info) for info in found))
    if arguments.json is not None:
        write_json(arguments.json, [info.as_json() for info in found] if len(found) > 1 else found[0].as_json())
    return 0


def _recover(arguments: argparse.Namespace) -> int:
    from gateway.recording.recovery import recover

    recovered = recover(arguments.log, arguments.out)
    print(f"{arguments.out}: {recovered.messages} messages recovered")
    losses = recovered.losses
    return WITH_LOSSES if losses.torn_bytes or losses.damaged_records or losses.unreadable_messages else 0
