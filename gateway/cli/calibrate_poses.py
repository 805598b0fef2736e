"""Arguments and run of the calibration methods that fit resting poses."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero
from gateway.cli.calibrate_record import add_record_arguments, finish_record, read_parent_record, use_recorded_device

if TYPE_CHECKING:
    from gateway.calibration.offline.readings_file import TableOptions


def add_pose_arguments(method: argparse.ArgumentParser) -> None:
    """Add the recordings, their columns and units, and the arguments of the record."""
    method.add_argument(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="recordings of a whole session or of one pose each: .csv, or the .mcap files of one gateway, or a folder of them",
    )
    add_record_arguments(method)
    add_table_arguments(method)


def add_table_arguments(method: argparse.ArgumentParser) -> None:
    """Add the columns, the unit and the rate of tables."""
    method.add_argument(
        "--unit",
        choices=("counts", "V", "g", "m/s2"),
        help="unit of the readings (default: by column name or size)",
    )
    method.add_argument(
        "--units-per-g",
        type=above_zero,
        metavar="N",
        help="nominal sensitivity (default: estimated from the readings)",
    )
    method.add_argument(
        "--columns", type=_columns, metavar="X,Y,Z", help="columns of the axes (default: found by their names)"
    )
    method.add_argument(
        "--time", metavar="COLUMN", help="column of the time in s, or, together with --rate, of a sample counter"
    )
    method.add_argument("--rate", type=above_zero, metavar="HZ", help="sample rate if there is no time column")


def table_options(arguments: argparse.Namespace) -> "TableOptions":
    """Return the options of the tables."""
    from gateway.calibration.offline.readings_file import TableOptions

    return TableOptions(arguments.unit, arguments.columns, arguments.time, arguments.rate)


def calibrate_poses(arguments: argparse.Namespace, **stated: float | None) -> int:
    """Calibrate and print the result; 1 if the readings do not determine it or the record is not acceptable.

    `stated` are the uncertainties of the method that `CalibrateOptions` takes; None leaves the default.
    """
    from gateway.calibration.offline.calibrate_files import CalibrateOptions, calibrate_files
    from gateway.calibration.record import NotDeterminedError
    from gateway.measurement.calibration_readings import read_calibration_readings

    files = read_calibration_readings(arguments.files, table_options(arguments))
    use_recorded_device(arguments, files)
    parent = read_parent_record(arguments)
    known = {name: value for name, value in stated.items() if value is not None}
    options = CalibrateOptions(arguments.method, arguments.units_per_g, parent=parent, **known)
    try:
        found = calibrate_files(files, options)
    except NotDeterminedError as error:
        print(f"plumbline calibrate: {error}", file=sys.stderr)
        return 1
    return finish_record(arguments, found.fit, found.unit, found.notes, parent)


def _columns(text: str) -> tuple[str, str, str]:
    names = [name.strip() for name in text.split(",")]
    if len(names) != 3 or not all(names):
        raise argparse.ArgumentTypeError(f"{text} is not three column names X,Y,Z")
    return names[0], names[1], names[2]
