"""`plumbline calibrate`: offline calibration, one module of the command line per method."""

import argparse
from importlib import import_module

METHODS = ("six_position", "norm_fit", "rotation", "single_parameter", "laser", "thermal", "align")
"""The methods, in the order of the help; `gateway.cli.calibrate_<name>` adds its own parser."""


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "calibrate",
        help="make a calibration record from recordings",
        description="Finds the resting poses in recordings and makes a calibration record, with the code of a live session.",
        epilog="example: plumbline calibrate six-position faces.csv --device-id adxl355-1d-0042 --json record.json",
    )
    methods = command.add_subparsers(dest="method", metavar="METHOD", required=True)
    for name in METHODS:
        import_module(f"gateway.cli.calibrate_{name}").add_to(methods)
