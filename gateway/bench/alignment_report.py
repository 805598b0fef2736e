"""The report of an alignment on a shaft: the peak-to-peak of each turn, its floor, and the errors that remain."""

import math

from gateway.bench.align_recording import RecordedTurns
from gateway.calibration.alignment.turn_advice import calibration_error_rad
from gateway.calibration.record_figure import FigureSeries, RecordFigure
from gateway.certificate.bench_report import ReportTable, render_bench_report
from gateway.documents.format import format_fixed, format_short

MAX_SHOWN_TURNS = 500
"""Turns that are shown, the last ones. Basis: a choice; more than anybody turns in a session, and a bound of the report."""


def render_alignment_report(name: str, found: RecordedTurns, housing_deviation_rad: float) -> str:
    """Return the page."""
    turns = found.turns[-MAX_SHOWN_TURNS:]
    last = turns[-1]
    numbers = tuple(float(number) for number in range(len(found.turns) - len(turns) + 1, len(found.turns) + 1))
    rows = tuple(
        (
            format_fixed(number, 0),
            format_fixed(one.time_s, 1),
            format_fixed(1000 * one.turn.peak_to_peak_g, 3),
            format_fixed(1000 * one.turn.floor_g, 3),
            format_fixed(math.degrees(one.turn.misalignment_rad), 4),
            format_fixed(math.degrees(2 * one.turn.u_rad), 4),
            one.advice.text,
        )
        for number, one in zip(numbers, turns, strict=True)
    )
    zeros = (0.0,) * len(turns)
    return render_bench_report(
        f"Alignment of axis {'xyz'[found.axis]}",
        facts=(
            ("Recording", name),
            ("Result", last.advice.state.replace("_", " ")),
            ("APE", f"{format_fixed(math.degrees(last.advice.precision_error_rad), 3)}°"),
            ("TAE", f"{format_fixed(math.degrees(last.advice.total_error_rad), 3)}°"),
            ("CE", f"{format_short(math.degrees(calibration_error_rad(housing_deviation_rad)))}°"),
            ("LSB", f"{format_short(1000 * found.step_g)} mg"),
        ),
        tables=(
            ReportTable(
                "Turns",
                ("turn", "end / s", "peak-to-peak / mg", "floor / mg", "misalignment / °", "U / °", "advice"),
                rows,
                "APE, TAE, CE: Łuczak et al. 2022, eq. 1 to 3; U: k = 2, of each component.",
            ),
        ),
        figures=(
            RecordFigure(
                title="Peak-to-peak of each turn",
                x_label="turn",
                y_label="peak-to-peak / mg",
                series=(
                    FigureSeries(
                        name="peak-to-peak",
                        x=numbers,
                        y=tuple(1000 * one.turn.peak_to_peak_g for one in turns),
                        u=zeros,
                    ),
                    FigureSeries(name="floor", x=numbers, y=tuple(1000 * one.turn.floor_g for one in turns), u=zeros),
                ),
                caption="The screws are turned between the turns until the peak-to-peak is at its floor.",
            ),
        ),
    )
