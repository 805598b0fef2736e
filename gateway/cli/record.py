"""`plumbline record`: what can be done with recordings, one verb in each module."""

import argparse
from importlib import import_module

VERBS = ("info", "verify", "recover", "export", "replay", "play", "incident")
"""In the order of the help; the verb `info` is in `gateway.cli.record_info`."""


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command with its verbs."""
    command = commands.add_parser(
        "record",
        help="show what is in recordings, and recover incomplete ones",
        description="Show what is in recordings, and recover incomplete ones.",
        epilog="example: plumbline record info plumbline-data",
    )
    verbs = command.add_subparsers(dest="verb", metavar="VERB", required=True)
    for verb in VERBS:
        import_module(f"gateway.cli.record_{verb}").add_to(verbs)
