"""`plumbline calibrate`: offline calibration, one module of the command line per method."""

import argparse
from importlib import import_module

METHODS = ("six_position", "norm_fit", "rotation", "single_parameter", "laser", "thermal", "align")
"""The methods, in the order of the help; `gateway.cli.calibrate_<name>` adds its own parser."""


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "calibrate",
        help="calibrate or align a sensor from recordings",
        description="Calibrate or align a sensor from recordings, by one of several methods; most of them make a calibration "
        "record.",
        epilog="example: plumbline calibrate six-position faces.csv --device-id adxl355-1d-0042 --json record.json",
    )
    methods = command.add_subparsers(dest="method", metavar="METHOD", required=True)
    for name in METHODS:
        import_module(f"gateway.cli.calibrate_{name}").add_to(methods)
