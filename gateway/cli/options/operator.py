"""Who makes a calibration or a measurement, on the command line."""

import argparse
import getpass


def add_operator(parser: argparse.ArgumentParser, task: str) -> None:
    """Add the option with the name of the person; `task` says what that person does."""
    parser.add_argument("--by", metavar="NAME", help=f"person who {task} (default: the current user)")


def operator(arguments: argparse.Namespace) -> str:
    """Return the person that is named, or the current user."""
    try:
        return str(arguments.by or getpass.getuser())
    except (KeyError, OSError):
        return "unknown"
