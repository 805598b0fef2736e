"""`plumbline calibrate laser`: displacement of a laser spot from photographs of a dot board."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import command, option
from gateway.cli.options.argument_types import above_zero
from gateway.cli.options.operator import operator, operator_option
from gateway.cli.terminal.output import output_file

if TYPE_CHECKING:
    from gateway.bench.laser.board import DotBoard
    from gateway.bench.laser.output import Measured


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
        _write_board(arguments)
        if not arguments.files:
            return 0
    if len(arguments.files) < 2:
        raise InputError("at least two photographs are needed: the zero, and one after the spot has moved")
    return _measure(arguments)


def _measure(arguments: argparse.Namespace) -> int:
    from gateway.bench.laser.displacement import check_different, displacement, measure_photograph
    from gateway.bench.laser.output import displacements_as_csv, displacements_as_json, format_displacements
    from gateway.bench.laser.photograph import read_photograph
    from gateway.cli.terminal.output import show, write_text
    from gateway.cli.terminal.progress import Progress

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
    from gateway.cli.terminal.output import write_bytes
    from gateway.errors import InputError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: no folder can be made there ({error.strerror}); choose another place") from error
    for number, (measured, displacement) in enumerate(found, start=1):
        name = f"{number:02d}-{measured.photograph.path.stem}.png"
        write_bytes(folder / name, draw_overlay(measured, found[0][0], displacement))


def _write_board(arguments: argparse.Namespace) -> None:
    from gateway.bench.laser.board import board_pdf
    from gateway.cli.terminal.output import write_bytes

    write_bytes(arguments.board, board_pdf(_board(arguments)))


def _board(arguments: argparse.Namespace) -> "DotBoard":
    from gateway.bench.laser.board import DotBoard

    columns, rows = arguments.lattice
    return DotBoard(columns, rows, arguments.pitch_mm / 1000, arguments.dot_mm / 1000, arguments.u_pitch_mm / 1000)
