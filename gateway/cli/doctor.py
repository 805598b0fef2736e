"""`plumbline doctor`: what is wrong on this machine, and how to correct it."""

import argparse
import sys
from pathlib import Path

MARKS = {"good": "ok  ", "note": "note", "bad": "BAD "}


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "doctor",
        help="find what is wrong on this machine, and how to correct it",
        description="Check everything that `plumbline run` needs, or ask the gateway that runs how it does. "
        "Exit code 0: all well; 1: something must be corrected.",
        epilog="examples: plumbline doctor --config adxl355.toml | plumbline doctor --device --config adxl355.toml",
    )
    command.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration (default: the installed one, or a simulated crane)"
    )
    command.add_argument(
        "--device",
        action="store_true",
        help="examine the sensor alone: the parts on its bus, its self-test, its readings; it must rest, and no gateway may run",
    )
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the result of each check; return 1 if one failed."""
    from gateway.configuration.loading import load
    from gateway.configuration.service_configuration import SETTINGS, is_installed, load_installed
    from gateway.daemon.doctor import examine, examine_sensor

    bad = False
    installed = is_installed() and arguments.config in (None, SETTINGS)
    configuration = load_installed() if installed else load(arguments.config)
    print(
        f"{MARKS['good']} {'settings':<12} {SETTINGS if installed else arguments.config or 'embedded default: a simulated crane'}"
    )
    for result in examine_sensor(configuration) if arguments.device else examine(configuration):
        print(f"{MARKS[result.grade]} {result.place:<12} {result.text}")
        sys.stdout.flush()
        bad |= result.grade == "bad"
    return 1 if bad else 0
