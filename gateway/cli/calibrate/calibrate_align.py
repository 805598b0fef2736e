"""`plumbline calibrate align`: how well an axis is aligned, from turns on a shaft; and the options of the aligning unit."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.argument_types import above_zero
from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION, output_file
from gateway.cli.recording_options import add_table_options, table_options

if TYPE_CHECKING:
    from gateway.bench.align_recording import RecordedTurns
    from gateway.calibration.alignment.turn_advice import AligningUnit


UNIT_OPTIONS = (
    option(
        "--unit-lead-mm", type=above_zero, default=0.5, metavar="MM", help="lead of an aligning screw (default 0.5, M3)"
    ),
    option(
        "--unit-lever-mm",
        type=above_zero,
        default=10.0,
        metavar="MM",
        help="distance from the hinge to that screw (default 10)",
    ),
    option(
        "--unit-reversed",
        action="append",
        choices=tuple("xyz"),
        default=[],
        help="turning in the screw about this axis turns the unit in the negative sense; may be repeated",
    ),
    option(
        "--own-units",
        action="store_true",
        help="each axis has an aligning unit of its own with two screws (default: one unit, three screws)",
    ),
)
"""The screws of the aligning unit in a housing; `aligning_unit` returns it. Basis: of the defaults, an M3 screw."""


def aligning_unit(arguments: argparse.Namespace) -> "AligningUnit":
    """Return the unit that the options describe."""
    from gateway.calibration.alignment.turn_advice import OWN_SCREWS, SHARED_SCREWS, AligningUnit

    return AligningUnit(
        lead_m=arguments.unit_lead_mm / 1000,
        lever_m=arguments.unit_lever_mm / 1000,
        reversed_axes=frozenset(arguments.unit_reversed),
        screws=OWN_SCREWS if arguments.own_units else SHARED_SCREWS,
    )


@command(
    "align",
    "turns about a horizontal shaft along one axis: peak-to-peak, which screw, aligned or not",
    "Read how far a sensitive axis is from parallel to the shaft about which the housing turns, from the "
    "peak-to-peak of its output over each turn (Łuczak et al. 2022, sec. 3), and which screw to turn. `plumbline remote "
    "align --on-shaft` shows the same live. Exit code 1: the last turn is not aligned.",
    "example: plumbline calibrate align turns_x.csv --axis x --html alignment.html",
    option("file", type=Path, metavar="FILE", help="recording of slow turns: .csv, .mcap of the gateway, or a folder"),
    option("--axis", choices=tuple("xyz"), help="axis along the shaft (default: the one that changes least)"),
    *UNIT_OPTIONS,
    option(
        "--perpendicularity-deg",
        type=above_zero,
        default=0.01,
        metavar="DEG",
        help="deviation of perpendicularity of the housing, DP (default %(default)s)",
    ),
    JSON_OPTION,
    option("--html", type=output_file, metavar="FILE", help="write a report with a figure"),
    add_table_options,
)
def run_align(arguments: argparse.Namespace) -> int:
    """Read the turns, and print the result; return 1 where the last one is not aligned."""
    from gateway.bench.align_recording import read_turns, render_alignment_report
    from gateway.cli.output import show, write_text
    from gateway.measurement.recording_files import read_calibration_readings

    (file,) = read_calibration_readings([arguments.file], table_options(arguments))
    unit = aligning_unit(arguments)
    deviation_rad = math.radians(arguments.perpendicularity_deg)
    found = read_turns(file, unit, None if arguments.axis is None else "xyz".index(arguments.axis), deviation_rad)
    result = _as_json(found, deviation_rad)
    if arguments.html is not None:
        write_text(arguments.html, render_alignment_report(str(arguments.file), found, deviation_rad))
    show(_as_text(found, deviation_rad), result, arguments.json)
    return 0 if found.turns[-1].advice.state == "aligned" else 1


def _as_text(found: "RecordedTurns", deviation_rad: float) -> str:
    from gateway.calibration.alignment.turn_advice import calibration_error_rad

    lines = [
        f"axis {'xyz'[found.axis]} along the shaft, {found.units_per_g:.6g} raw units per g, LSB {1000 * found.step_g:.3g} mg"
    ]
    lines += [
        f"turn {number:2} to {one.time_s:7.1f} s: {1000 * one.turn.peak_to_peak_g:8.3f} mg peak-to-peak, floor "
        f"{1000 * one.turn.floor_g:.3f} mg, off by {math.degrees(one.turn.misalignment_rad):.3f} deg; {one.advice.text}"
        for number, one in enumerate(found.turns, start=1)
    ]
    last = found.turns[-1].advice
    lines.append(
        f"APE {math.degrees(last.precision_error_rad):.3f} deg, TAE {math.degrees(last.total_error_rad):.3f} deg, "
        f"CE {math.degrees(calibration_error_rad(deviation_rad)):.5f} deg"
    )
    return "\n".join(lines)


def _as_json(found: "RecordedTurns", deviation_rad: float) -> dict[str, Any]:
    from gateway.calibration.alignment.turn_advice import calibration_error_rad

    return {
        "axis": "xyz"[found.axis],
        "units_per_g": found.units_per_g,
        "step_g": found.step_g,
        "calibration_error_rad": calibration_error_rad(deviation_rad),
        "turns": [
            {
                "time_s": one.time_s,
                "peak_to_peak_g": one.turn.peak_to_peak_g,
                "floor_g": one.turn.floor_g,
                "towards_rad": list(one.turn.towards),
                "u_rad": one.turn.u_rad,
                "state": one.advice.state,
                "screw_axis": one.advice.screw_axis,
                "direction": one.advice.direction,
                "screw_turns": one.advice.turns,
                "precision_error_rad": one.advice.precision_error_rad,
                "total_error_rad": one.advice.total_error_rad,
            }
            for one in found.turns
        ],
    }
