"""`plumbline calibrate six-position`, `norm-fit` and `rotation`: from resting poses, or from turns on a rig with known angles."""

import argparse
from pathlib import Path

from gateway.calibration.record import ROTATION, PoseMethod
from gateway.cli.argument_types import above_zero
from gateway.cli.calibrate.calibrate_record import (
    RECORD_OPTIONS,
    finish_record,
    read_parent_record,
    use_recorded_device,
)
from gateway.cli.command import command, option
from gateway.cli.recording_options import add_table_options, table_options

POSE_OPTIONS = (
    option(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="recordings of a whole session or of one pose each: .csv, or the .mcap files of one gateway, or a folder of them",
    ),
    *RECORD_OPTIONS,
    add_table_options,
)
"""The recordings, their columns and units, and the record."""


@command(
    PoseMethod.SIX_POSITION.value,
    "six faces up in turn, on a levelled surface, in any order",
    "Determine offset, scale factor and misalignment from the six faces, in any order. Repeats are averaged.",
    "example: plumbline calibrate six-position faces.csv --device-id part-7 --json record.json",
    *POSE_OPTIONS,
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
    *POSE_OPTIONS,
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

    `stated` are the uncertainties of the method that `calibrate_files` takes; None leaves the default.
    """
    from gateway.calibration.calibrate_files import calibrate_files
    from gateway.measurement.recording_files import read_calibration_readings

    files = read_calibration_readings(arguments.files, table_options(arguments))
    use_recorded_device(arguments, files)
    parent = read_parent_record(arguments)
    known = {name: value for name, value in stated.items() if value is not None}
    fit, notes = calibrate_files(files, arguments.method, arguments.units_per_g, parent, **known)
    return finish_record(arguments, fit, files[0].unit, notes, parent)


@command(
    ROTATION,
    "full turns about horizontal axes, on a rig with a known angle",
    "Fit sine and cosine to one full turn (two axes) or two turns about different axes (all three, and a "
    "record): offset, scale factor, phase shift, non-orthogonality, intervals. Each file is one turn: columns angle_deg and "
    "ax_g,ay_g,az_g (or _v, _counts), optionally count (readings averaged in the row) and temperature_c.",
    "example: plumbline calibrate rotation about_y.csv about_x.csv --device-id part-7 --json record.json",
    option("files", type=Path, nargs="+", metavar="FILE", help="CSV: one file per turn"),
    *RECORD_OPTIONS,
    option(
        "--mounting-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the housing's attitude on the rig, about each of three directions (default 0.1)",
    ),
)
def run_rotation(arguments: argparse.Namespace) -> int:
    """Fit the turns; return 1 where the record is not acceptable."""
    from gateway.bench.input_tables import read_turn
    from gateway.bench.rotation import MOUNTING_U_DEG, fit_rotation
    from gateway.bench.rotation_output import format_rotation, rotation_fields
    from gateway.errors import InputError

    parent = read_parent_record(arguments)
    wants_record = arguments.json is not None or arguments.html is not None
    if wants_record and len(arguments.files) == 1:
        raise InputError(
            f"{arguments.files[0]}: one turn calibrates two axes; a record needs a second turn, about another axis"
        )
    turns = [read_turn(path) for path in arguments.files]
    units = {unit for _, unit in turns}
    if len(units) > 1:
        raise InputError(f"the turns are in {' and '.join(sorted(units))}; calibrate from one unit")
    (unit,) = units
    fit = fit_rotation(tuple(turn for turn, _ in turns), arguments.mounting_deg or MOUNTING_U_DEG)
    text = format_rotation(fit, unit)
    if fit.calibration is None:
        print(text)
        return 0
    return finish_record(arguments, fit.calibration, unit, (), parent, rotation_fields(fit), preface=f"{text}\n\n")
