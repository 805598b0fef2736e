"""Who makes a calibration or a measurement, on the command line."""

import argparse
import getpass

from gateway.cli.command import AddTo, option


def operator_option(task: str) -> AddTo:
    """Return the option with the name of the person; `task` says what that person does."""
    return option("--by", metavar="NAME", help=f"person who {task} (default: the current user)")


def operator(arguments: argparse.Namespace) -> str:
    """Return the person that is named, or the current user."""
    try:
        return str(arguments.by or getpass.getuser())
    except (KeyError, OSError):
        return "unknown"
