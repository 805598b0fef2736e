"""`plumbline calibrate single-parameter` and `laser`: angles against a laser beam, and the way of its spot on a board."""

import argparse
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.calibration.record import SINGLE_PARAMETER
from gateway.cli.argument_types import above_zero, operator, operator_option
from gateway.cli.calibrate.calibrate_record import RECORD_OPTIONS, identity_note, read_parent_record, write_record
from gateway.cli.command import command, option
from gateway.cli.output import output_file

if TYPE_CHECKING:
    from gateway.bench.laser.board import DotBoard
    from gateway.bench.laser.output import Measured
    from gateway.bench.single_parameter import SingleParameterFit


@command(
    SINGLE_PARAMETER,
    "relative angles within 5 degrees, against a laser beam on the same platform",
    "Determine A_z,off, the one parameter that corrects relative angles within +-5 deg, from pairs of the "
    "displacement of a laser spot (calibrate laser measures it) and the raw relative angle. Each file is one session: "
    "columns displacement_mm and raw_angle_deg, optionally u_displacement_mm, all counted from the session's zero.",
    "example: plumbline calibrate single-parameter pairs.csv --distance-mm 3897 --device-id part-7 --json record.json",
    option("files", type=Path, nargs="+", metavar="FILE", help="CSV: one file per session"),
    *RECORD_OPTIONS,
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
    from gateway.cli.output import show, write_text
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


def _lattice(text: str) -> tuple[int, int]:
    numbers = re.fullmatch(r"(\d{1,2})x(\d{1,2})", text)
    if numbers is None or min(map(int, numbers.groups())) < 4:
        raise argparse.ArgumentTypeError(f"{text} is not a lattice such as 7x7, of 4 dots or more each way")
    return int(numbers[1]), int(numbers[2])


@command(
    "laser",
    "displacement of a laser spot, from photographs of a dot board",
    "Measure the displacement of a laser spot on a board of dots in each photograph, relative to the first one, "
    "with its uncertainty. Dots, perspective and the lens give the scale at every place. The whole board must be visible. "
    "The result is for calibrate single-parameter.",
    "example: plumbline calibrate laser zero.jpg tilted-*.jpg --csv displacements.csv --overlay found/",
    option("files", type=Path, nargs="*", metavar="PHOTO", help="photographs; the first one is the zero"),
    option("--lattice", type=_lattice, default=(7, 7), metavar="CxR", help="columns and rows of dots (default 7x7)"),
    option(
        "--pitch-mm", type=above_zero, default=40.0, metavar="MM", help="distance of neighbouring dots (default 40)"
    ),
    option("--dot-mm", type=above_zero, default=20.0, metavar="MM", help="diameter of a dot (default 20)"),
    option(
        "--u-pitch-mm",
        type=above_zero,
        default=0.003,
        metavar="MM",
        help="standard uncertainty of the pitch, common to the board (default 0.003: +-0.005 of a machined one)",
    ),
    option("--colour", choices=("red", "green"), default="red", help="colour of the laser (default red)"),
    operator_option("measures"),
    option(
        "--json", type=output_file, metavar="FILE", help="write all results to FILE; -: print them instead of the text"
    ),
    option(
        "--csv",
        type=output_file,
        metavar="FILE",
        help="write the displacements to FILE; add the column raw_angle_deg to it",
    ),
    option("--overlay", type=Path, metavar="FOLDER", help="write each photograph with what was found in it to FOLDER"),
    option("--board", type=output_file, metavar="FILE.pdf", help="write a printable board at true size to FILE.pdf"),
)
def run_laser(arguments: argparse.Namespace) -> int:
    """Measure the displacements, or write a board."""
    from gateway.errors import InputError
    from gateway.extras import require_extra

    require_extra("laser")
    if arguments.dot_mm >= 0.8 * arguments.pitch_mm:
        raise InputError(
            f"--dot-mm {arguments.dot_mm:g} leaves no white between dots of --pitch-mm {arguments.pitch_mm:g}"
        )
    if arguments.board is not None:
        from gateway.bench.laser.board import board_pdf
        from gateway.cli.output import write_bytes

        write_bytes(arguments.board, board_pdf(_board(arguments)))
        if not arguments.files:
            return 0
    if len(arguments.files) < 2:
        raise InputError("at least two photographs are needed: the zero, and one after the spot has moved")
    return _measure(arguments)


def _measure(arguments: argparse.Namespace) -> int:
    from gateway.bench.laser.displacement import check_different, displacement, measure_photograph
    from gateway.bench.laser.output import displacements_as_csv, displacements_as_json, format_displacements
    from gateway.bench.laser.photograph import read_photograph
    from gateway.cli.output import show, write_text
    from gateway.cli.progress import Progress

    board = _board(arguments)
    with Progress() as progress:
        photographs = []
        for number, path in enumerate(arguments.files, start=1):
            progress.tick(f"photograph {number} of {len(arguments.files)}")
            photographs.append(measure_photograph(read_photograph(path, arguments.colour), board))
    check_different(photographs)
    found = [(each, displacement(photographs[0], each)) for each in photographs]
    if arguments.overlay is not None:
        _write_overlays(arguments.overlay, found)
    if arguments.csv is not None:
        write_text(arguments.csv, displacements_as_csv(found))
    show(format_displacements(found), displacements_as_json(found, operator(arguments)), arguments.json)
    return 0


def _write_overlays(folder: Path, found: "Measured") -> None:
    from gateway.bench.laser.output import draw_overlay
    from gateway.cli.output import write_bytes
    from gateway.errors import InputError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: no folder can be made there ({error.strerror}); choose another place") from error
    for number, (measured, displacement) in enumerate(found, start=1):
        name = f"{number:02d}-{measured.photograph.path.stem}.png"
        write_bytes(folder / name, draw_overlay(measured, found[0][0], displacement))


def _board(arguments: argparse.Namespace) -> "DotBoard":
    from gateway.bench.laser.board import DotBoard

    columns, rows = arguments.lattice
    return DotBoard(columns, rows, arguments.pitch_mm / 1000, arguments.dot_mm / 1000, arguments.u_pitch_mm / 1000)
