"""`plumbline doctor`: what is wrong on this machine, and how to mend it."""

import argparse
import sys
from pathlib import Path

MARKS = {"good": "ok  ", "note": "note", "bad": "BAD "}


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "doctor",
        help="what is wrong on this machine, and how to mend it",
        description="Look at everything that `plumbline run` needs. Exit 0: it can run; 1: something must be mended first.",
        epilog="example: plumbline doctor --config adxl355.toml",
    )
    command.add_argument("--config", type=Path, metavar="FILE", help="without one: the embedded default")
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the findings."""
    from gateway.configuration.loading import load
    from gateway.daemon.doctor import examine

    bad = False
    for finding in examine(load(arguments.config)):
        print(f"{MARKS[finding.grade]} {finding.place:<12} {finding.text}")
        sys.stdout.flush()
        bad |= finding.grade == "bad"
    return 1 if bad else 0
