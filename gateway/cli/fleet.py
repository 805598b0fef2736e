"""`plumbline fleet`: many sensors, many gateways."""

import argparse
from importlib import import_module

VERBS = ("status", "page", "metrics", "router", "drift", "deflection")
"""The verbs, in the order of the help; `gateway.cli.fleet_<name>` adds its own parser."""


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command with its verbs."""
    command = commands.add_parser(
        "fleet",
        help="many sensors and gateways: their state, which to calibrate next, what several measure together",
        description="Many sensors and gateways: their state, which to calibrate next, what several measure together.",
        epilog="example: plumbline fleet status --expect gateways.txt",
    )
    verbs = command.add_subparsers(dest="verb", metavar="VERB", required=True)
    for name in VERBS:
        import_module(f"gateway.cli.fleet_{name}").add_to(verbs)
