"""The turns of a sensor on a shaft from a recording, and the report: peak-to-peak, its floor, and the errors that remain."""

import math
from dataclasses import dataclass

import numpy as np

from gateway.calibration.alignment.turn_advice import (
    HOUSING_DEVIATION_RAD,
    MIN_ACROSS_G,
    AligningUnit,
    Turn,
    TurnAdvice,
    calibration_error_rad,
)
from gateway.calibration.alignment.turn_assistant import TurnMonitor
from gateway.calibration.input_files import FileReadings
from gateway.calibration.pose import quantisation_u
from gateway.calibration.record import FigureSeries, NotDeterminedError, RecordFigure
from gateway.certificate.bench_report import ReportTable, render_bench_report
from gateway.documents.format import format_fixed, format_short
from gateway.numerics.stats import means_by_group, smallest_steps

TILT_AVERAGE_S = 0.1
"""Duration of an average, s, as live. Definition: the period of the tilts, as live."""
MAX_SHOWN_TURNS = 500
"""Turns that are shown, the last ones. Basis: a choice; more than anybody turns in a session, and a bound of the report."""


@dataclass(frozen=True, slots=True)
class RecordedTurn:
    """One turn of a recording."""

    time_s: float
    """Its end, from the start of the recording."""
    turn: Turn
    advice: TurnAdvice


@dataclass(frozen=True, slots=True)
class RecordedTurns:
    """The turns of a recording."""

    axis: int
    units_per_g: float
    """Scale factor of the axes across the shaft, raw units per g."""
    step_g: float
    """Quantisation step of the axis along the shaft, LSB, g."""
    turns: tuple[RecordedTurn, ...]


def read_turns(
    file: FileReadings,
    unit: AligningUnit | None = None,
    axis: int | None = None,
    housing_deviation_rad: float = HOUSING_DEVIATION_RAD,
) -> RecordedTurns:
    """Return the turns about the axis along the shaft; None: the axis whose readings change least.

    The scale factor is that of the axes across the shaft, which a turn takes from -1 g to +1 g. Raises `NotDeterminedError`
    without a full turn.
    """
    begun_s = file.time_s - file.time_s[0]
    means, scatter = means_by_group(np.floor(begun_s / TILT_AVERAGE_S), np.column_stack([begun_s, file.raw]))
    time_s, raw, sigma = means[:, 0], means[:, 1:], scatter[1:]
    half = np.ptp(raw, axis=0) / 2
    axis = int(np.argmin(half)) if axis is None else axis
    across = [other for other in range(3) if other != axis]
    if half[across].min() <= 0 or half[axis] > MIN_ACROSS_G * half[across].min():
        raise NotDeterminedError(
            f"{file.path}: no axis stays level while the others turn; turn the sensor on its shaft"
        )
    scale = half.copy()
    scale[axis] = half[across].mean()
    zero = (raw.max(axis=0) + raw.min(axis=0)) / 2
    step = float(smallest_steps(file.raw)[axis])
    undithered_step_g = math.sqrt(12) * float(quantisation_u(step, sigma)[axis] / scale[axis])
    monitor = TurnMonitor(unit, axis, step_g=undithered_step_g, housing_deviation_rad=housing_deviation_rad)
    turns: list[RecordedTurn] = []
    for moment, force_g in zip(time_s.tolist(), (raw - zero) / scale, strict=True):
        view = monitor.add(moment, force_g)
        if view.n_turns > len(turns) and view.turn is not None and view.advice is not None:
            turns.append(RecordedTurn(moment, view.turn, view.advice))
    if not turns:
        raise NotDeterminedError(f"{file.path}: no full turn of the shaft; turn it slowly, once round or more")
    return RecordedTurns(axis, float(scale[axis]), step / float(scale[axis]), tuple(turns))


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
