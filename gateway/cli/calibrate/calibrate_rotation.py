"""`plumbline calibrate rotation`: full turns about horizontal axes on a rig with a known angle."""

import argparse
from pathlib import Path

from gateway.calibration.record import ROTATION
from gateway.cli.calibrate.calibrate_record import add_record_arguments, finish_record, read_parent_record
from gateway.cli.command import command, option
from gateway.cli.options.argument_types import above_zero


@command(
    ROTATION,
    "full turns about horizontal axes, on a rig with a known angle",
    "Fit sine and cosine to one full turn (two axes) or two turns about different axes (all three, and a "
    "record): offset, scale factor, phase shift, non-orthogonality, intervals. Each file is one turn: columns angle_deg and "
    "ax_g,ay_g,az_g (or _v, _counts), optionally count (readings averaged in the row) and temperature_c.",
    "example: plumbline calibrate rotation about_y.csv about_x.csv --device-id part-7 --json record.json",
    option("files", type=Path, nargs="+", metavar="FILE", help="CSV: one file per turn"),
    add_record_arguments,
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
