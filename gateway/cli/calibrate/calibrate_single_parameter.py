"""`plumbline calibrate single-parameter`: relative angles against a laser beam."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.calibration.record import SINGLE_PARAMETER
from gateway.cli.calibrate.calibrate_record import add_record_arguments, identity_note, read_parent_record, write_record
from gateway.cli.command import command, option
from gateway.cli.options.argument_types import above_zero
from gateway.cli.terminal.output import output_file

if TYPE_CHECKING:
    from gateway.bench.single_parameter import SingleParameterFit


@command(
    SINGLE_PARAMETER,
    "relative angles within 5 degrees, against a laser beam on the same platform",
    "Determine A_z,off, the one parameter that corrects relative angles within +-5 deg, from pairs of the "
    "displacement of a laser spot (calibrate laser measures it) and the raw relative angle. Each file is one session: "
    "columns displacement_mm and raw_angle_deg, optionally u_displacement_mm, all counted from the session's zero.",
    "example: plumbline calibrate single-parameter pairs.csv --distance-mm 3897 --device-id part-7 --json record.json",
    option("files", type=Path, nargs="+", metavar="FILE", help="CSV: one file per session"),
    add_record_arguments,
    option("--distance-mm", type=above_zero, required=True, metavar="MM", help="from the rotation axis to the board"),
    option(
        "--u-distance-mm", type=above_zero, default=1.5, metavar="MM", help="its standard uncertainty (default 1.5)"
    ),
    option(
        "--u-displacement-mm",
        type=above_zero,
        default=0.05,
        metavar="MM",
        help="standard uncertainty of a displacement where the file has none (default 0.05)",
    ),
    option(
        "--u-angle-deg",
        type=above_zero,
        default=0.001,
        metavar="DEG",
        help="standard uncertainty of a raw relative angle (default 0.001)",
    ),
    option(
        "--square-deg",
        type=above_zero,
        default=0.2,
        metavar="DEG",
        help="standard uncertainty of the angle between the beam at zero and the board's normal (default 0.2)",
    ),
    option(
        "--zero-g-mg",
        type=above_zero,
        default=25.0,
        metavar="MG",
        help="data-sheet limit of the zero-g offsets of x and y, +- (default 25)",
    ),
    option(
        "--apply", type=Path, metavar="FILE", help="correct the raw relative angles of this CSV (column raw_angle_deg)"
    ),
    option("--corrected", type=output_file, metavar="FILE", help="write the corrected angles to FILE"),
)
def run_single_parameter(arguments: argparse.Namespace) -> int:
    """Determine the parameter, and correct angles with it where that is asked for."""
    from gateway.bench.input_tables import read_pairs
    from gateway.bench.single_parameter import LaserSetup, fit_single_parameter
    from gateway.bench.single_parameter_output import (
        as_calibration,
        format_single_parameter,
        single_parameter_fields,
    )
    from gateway.calibration.record import NotDeterminedError
    from gateway.cli.terminal.output import show, write_text
    from gateway.errors import InputError

    if (arguments.apply is None) != (arguments.corrected is None):
        raise InputError("--apply and --corrected belong together: the angles to correct, and where to write them")
    setup = LaserSetup(
        distance_m=arguments.distance_mm / 1000,
        u_distance_m=arguments.u_distance_mm / 1000,
        u_raw_angle_rad=math.radians(arguments.u_angle_deg),
        u_square_rad=math.radians(arguments.square_deg),
        u_zero_g_offset_g=arguments.zero_g_mg / 1000 / math.sqrt(3),
    )
    parent = read_parent_record(arguments)
    pairs = read_pairs(arguments.files, arguments.u_displacement_mm / 1000)
    try:
        fit = fit_single_parameter(pairs, setup)
    except NotDeterminedError as error:
        raise NotDeterminedError(f"{', '.join(map(str, arguments.files))}: {error}") from error
    corrected = None if arguments.apply is None else _correct(arguments.apply, fit)
    record = write_record(arguments, as_calibration(fit), "g", parent, single_parameter_fields(fit))
    if corrected is not None:
        write_text(arguments.corrected, corrected)
    text = format_single_parameter(fit, identity_note(arguments.device_id))
    show(text, record.model_dump(mode="json"), arguments.json)
    return 0


def _correct(path: Path, fit: "SingleParameterFit") -> str:
    """Return the corrected angles of a file as CSV. Raises `InputError` for an angle beyond the range, with the file."""
    from gateway.bench.input_tables import read_raw_angles
    from gateway.bench.single_parameter import correct_relative_angle, relative_angle_u_rad
    from gateway.bench.single_parameter_output import format_corrected
    from gateway.errors import InputError

    raw_rad = read_raw_angles(path)
    try:
        corrected_rad = correct_relative_angle(raw_rad, fit.a_z_off_g)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return format_corrected(raw_rad, corrected_rad, relative_angle_u_rad(raw_rad, fit, fit.setup.u_raw_angle_rad))
