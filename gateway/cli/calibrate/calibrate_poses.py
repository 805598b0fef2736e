"""`plumbline calibrate six-position` and `norm-fit`: a calibration from resting poses, of six faces or of many attitudes."""

import argparse
from pathlib import Path

from gateway.calibration.record import PoseMethod
from gateway.cli.calibrate.calibrate_record import (
    add_record_arguments,
    finish_record,
    read_parent_record,
    use_recorded_device,
)
from gateway.cli.command import command, option
from gateway.cli.options.argument_types import above_zero
from gateway.cli.options.recording_options import add_table_options, table_options


def _add_pose_arguments(method: argparse.ArgumentParser) -> None:
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


@command(
    PoseMethod.SIX_POSITION.value,
    "six faces up in turn, on a levelled surface, in any order",
    "Determine offset, scale factor and misalignment from the six faces, in any order. Repeats are averaged.",
    "example: plumbline calibrate six-position faces.csv --device-id part-7 --json record.json",
    _add_pose_arguments,
    option(
        "--placement-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the faces' placement: level of the surface, squareness of the housing (default 0.1)",
    ),
)
def run_six_position(arguments: argparse.Namespace) -> int:
    """Calibrate from six faces."""
    return _calibrate(arguments, placement_u_deg=arguments.placement_deg)


@command(
    PoseMethod.NORM_FIT.value,
    "nine or more poses in all directions; no levelled surface needed",
    "Determine offset, scale factor and non-orthogonality from |m| = 1 g in nine or more attitudes in all "
    "directions. Twelve are better, because the additional poses check the fit.",
    "example: plumbline calibrate norm-fit session.csv --unit counts --rate 100 --json record.json",
    _add_pose_arguments,
    option(
        "--frame-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the attitude of the sensor's axes in the housing, which this method does not measure "
        "(default 0.58)",
    ),
)
def run_norm_fit(arguments: argparse.Namespace) -> int:
    """Calibrate from poses in all directions."""
    return _calibrate(arguments, frame_u_deg=arguments.frame_deg)


def _calibrate(arguments: argparse.Namespace, **stated: float | None) -> int:
    """Calibrate and print the result; 1 if the readings do not determine it or the record is not acceptable.

    `stated` are the uncertainties of the method that `CalibrateOptions` takes; None leaves the default.
    """
    from gateway.calibration.calibrate_files import CalibrateOptions, calibrate_files
    from gateway.measurement.recording_files import read_calibration_readings

    files = read_calibration_readings(arguments.files, table_options(arguments))
    use_recorded_device(arguments, files)
    parent = read_parent_record(arguments)
    known = {name: value for name, value in stated.items() if value is not None}
    options = CalibrateOptions(arguments.method, arguments.units_per_g, parent=parent, **known)
    found = calibrate_files(files, options)
    return finish_record(arguments, found.fit, found.unit, found.notes, parent)
