"""Arguments and run of the calibration methods that fit resting poses."""

import argparse
import sys
from pathlib import Path

from gateway.cli.calibrate_record import add_record_arguments, finish_record, read_parent_record, use_recorded_device
from gateway.cli.table_options import add_table_options, table_options


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
    add_table_options(method)


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
