"""The gap, step by step and on each part of the data: chi-square, multiple of the noise, and the equivalent rope angle.

A free swing of the rope's angle phi reads (1 - p/L) sin(phi) g across the rope, at a housing p below the pivot on a rope of
length L (derived from the equations of motion; exact for a fixed pivot). A residual across the rope, read as such a swing,
becomes an angle, and the angle times L a displacement of the load.
"""

import math
import textwrap
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from gateway.documents.figures import AFTER, INK, MEASURED, Figure
from gateway.documents.format import format_number, format_percent, human_name
from gateway.documents.plots import add_legend, label_decades, render_svg
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Comparison, Curves, Gap, Reconciliation, Step
from gateway.twin.report.text import NOMINAL, caution, final_model_name, format_change, format_noise_ratio, noise_ratio

Array = NDArray[np.float64]
LABEL_IN, LABEL_LETTERS = 1.45, 22
NARROW_IN = 5.0
"""Width of the narrow figure. Basis: it fits a phone without scrolling."""
LEAST_SHOWN = 0.05
SAME = 0.01
"""Relative: the last step's gap is the final one."""
MIN_TRANSVERSE_SENSITIVITY = 0.1
"""Least |1 - p/L|, in g per radian. Basis: there a position that is known to 5 % of the length makes the angle uncertain by
half."""
NOISE_DEVIATIONS = 2.0
"""A residual variance within so many standard deviations of the noise's own is no more than an upper bound."""
NOT_DETERMINED = "not determined"
ANGLE_DIGITS = 2


@dataclass(frozen=True, slots=True)
class GapRow:
    """A model on the way, with its gap."""

    label: str
    log: float
    held_out: float


def gap_content(result: Reconciliation, compared: Comparison) -> dict[str, object]:
    """Return the figure, the gap on each part of the data, and what the housing's place shows of the rope's angle."""
    sensitivity = transverse_sensitivity(result.rig)
    rows = gap_rows(compared.gap, result.steps, final_model_name(result), frozenset(result.model))
    svg = render_svg("gap", _row_label(rows), 0.9 + 0.5 * len(rows), lambda canvas: _draw(canvas, rows), NARROW_IN)
    caption = "Each row adds an effect to the model or removes one. The scale is logarithmic."
    return {
        "figure": Figure(svg, f"{caption} {caution(result)}".rstrip()),
        "parts": part_rows(compared, result.rig),
        "sensitivity": sensitivity,
        "shows_angle": abs(sensitivity) >= MIN_TRANSVERSE_SENSITIVITY,
        "gain": _gain(compared.gap),
    }


def gap_rows(gap: Gap, steps: tuple[Step, ...], name: str, effects: frozenset[str]) -> list[GapRow]:
    """Return rows from the nominal model over every step to the model after, of that name and with these effects.

    The last step leads elsewhere where held-out data preferred another model, or one of several that fit equally is shown.
    """
    rows = [GapRow(NOMINAL, gap.before_log, gap.before_held_out)]
    names: frozenset[str] = frozenset()
    for step in steps:
        label = _step_label(frozenset(step.names) - names, names - frozenset(step.names))
        if label:
            rows.append(GapRow(label, step.gap_log, step.gap_held_out))
        names = frozenset(step.names)
    elsewhere = len(rows) > 1 and not names <= effects
    if elsewhere or abs(rows[-1].log - gap.after_log) > SAME * abs(gap.after_log):
        rows.append(GapRow(textwrap.fill(name, LABEL_LETTERS), gap.after_log, gap.after_held_out))
    return rows


def _step_label(added: frozenset[str], dropped: frozenset[str]) -> str:
    """Return what a step added and removed; effects found before the search are added in the first row."""
    changes = [f"+ {human_name(name)}" for name in sorted(added)] + [
        f"− {human_name(name)}" for name in sorted(dropped)
    ]
    return "\n".join(textwrap.fill(change, LABEL_LETTERS) for change in changes)


def _row_label(rows: list[GapRow]) -> str:
    """Return the rows as text for screen readers."""
    return "Reduced chi-square: " + "; ".join(
        f"{' '.join(row.label.split())} {format_number(row.log)}, held-out {format_number(row.held_out)}"
        for row in rows
    )


def _draw(canvas: Canvas, rows: list[GapRow]) -> None:
    width, height = canvas.get_size_inches()
    margins = {"left": LABEL_IN / width, "right": 1 - 0.05 / width, "bottom": 0.48 / height, "top": 1 - 0.3 / height}
    axes = canvas.subplots(gridspec_kw=margins)
    for i, row in enumerate(rows):
        _bar(axes, i - 0.19, row.log, AFTER, "data of the fit" if i == 0 else "")
        _bar(axes, i + 0.19, row.held_out, MEASURED, "held-out data" if i == 0 else "")
    shown = [value for row in rows for value in (row.log, row.held_out)]
    axes.set_xscale("log")
    label_decades(axes.xaxis)
    axes.set_xlim(min(0.7, *shown, 0.7), max(10.0, *shown) ** 1.6)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_yticks(range(len(rows)), [row.label for row in rows])
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    axes.axvline(1.0, color=INK, linewidth=1.0)
    axes.set_xlabel("gap: reduced chi-square of the residual (1 = noise alone)")
    add_legend(canvas)


def _bar(axes: Axes, place: float, value: float, color: str, label: str) -> None:
    shown = max(value, LEAST_SHOWN)
    axes.barh(place, shown - 1.0, left=1.0, height=0.34, color=color, label=label or None)
    text = f"{format_number(value)}  ({format_noise_ratio(value)})"
    axes.text(max(shown, 1.0) * 1.06, place, text, va="center", fontsize=7.5)


def _gain(gap: Gap) -> str:
    if gap.before_test == gap.after_test:
        return "The gap is the same before and after."
    low, high = gap.test_interval
    return (
        f"On the test part the final model reduces the chi-square by {format_number(gap.before_test - gap.after_test)} "
        f"(95 % interval {format_number(low)} to {format_number(high)}, block bootstrap)."
    )


@dataclass(frozen=True, slots=True)
class RopeAngleError:
    """Equivalent error of a simulated rope angle, rms."""

    angle_rad: float
    displacement_m: float
    """At the load."""
    is_upper_bound: bool
    """The residual is not larger than the noise can be."""

    @property
    def texts(self) -> tuple[str, str]:
        """Angle and displacement as they are printed."""
        bound, numbers = "< " if self.is_upper_bound else "", (math.degrees(self.angle_rad), 100 * self.displacement_m)
        angle, displacement = (f"{bound}{format_number(each, ANGLE_DIGITS)}" for each in numbers)
        return f"{angle}°", f"{displacement} cm"


def transverse_sensitivity(rig: TwinRig) -> float:
    """Return 1 - p/L: the reading across the rope in g per radian of a free swing."""
    return 1 - rig.position_m / rig.length_m


def rope_angle_error(residual_g: Array, rig: TwinRig) -> RopeAngleError | None:
    """Return the rope angle that a residual of x, y, z (n, 3) is equivalent to, the noise's variance subtracted.

    None where the housing is so close to the load that the transverse channels do not show the angle.
    """
    sensitivity = abs(transverse_sensitivity(rig))
    if sensitivity < MIN_TRANSVERSE_SENSITIVITY or not len(residual_g):
        return None
    variance_g2 = np.square(np.array(rig.noise_g[:2], dtype=np.float64))
    excess_g2 = float(np.square(residual_g[:, :2]).sum(axis=1).mean() - variance_g2.sum())
    bound_g2 = NOISE_DEVIATIONS * math.sqrt(2 * float(np.square(variance_g2).sum()) / len(residual_g))
    is_upper_bound = excess_g2 <= bound_g2
    transverse_g = math.sqrt(max(excess_g2, 0.0) + bound_g2 if is_upper_bound else excess_g2)
    angle_rad = math.asin(min(1.0, transverse_g / sensitivity))
    return RopeAngleError(angle_rad, rig.length_m * angle_rad, is_upper_bound)


def fitted_part_name(compared: Comparison) -> str:
    """Return the name of what the model was fitted to."""
    return "first two thirds of the recording" if compared.held_out_is_last_third else "recording"


def held_out_name(compared: Comparison) -> str:
    """Return the name of what was held out of the fit."""
    return "last third of the recording" if compared.held_out_is_last_third else "held-out recording"


@dataclass(frozen=True, slots=True)
class PartRow:
    """The gap on a part of the data, before → after."""

    name: str
    role: str
    chi2: str
    rms: str
    """In multiples of the noise."""
    closed: str
    """Percent of the gap that the final model closes."""
    angle: str
    """Equivalent error of the rope's angle, rms."""
    displacement: str
    """The same at the load."""


def part_rows(compared: Comparison, rig: TwinRig) -> tuple[PartRow, ...]:
    """Return the gap on each part of the data; of the last, which no choice rests on, it is to be quoted."""
    gap, log, held_out = compared.gap, compared.log, compared.held_out
    time_s, test = held_out.recording_time_s, next(part for part in compared.parts if part.role == "test")
    in_test = np.any([(time_s >= from_s) & (time_s <= to_s) for from_s, to_s in test.blocks_s], axis=0)
    of_test = replace(held_out, used=held_out.used & in_test)
    name = held_out_name(compared)
    return (
        _part_row(fitted_part_name(compared), "fit", gap.before_log, gap.after_log, log, rig),
        _part_row(name, "selection, test", gap.before_held_out, gap.after_held_out, held_out, rig),
        _part_row(f"test part of the {name}", "test", gap.before_test, gap.after_test, of_test, rig),
    )


def _part_row(name: str, role: str, before: float, after: float, curves: Curves, rig: TwinRig) -> PartRow:
    closed = Gap.closed_percent(before, after)
    return PartRow(
        name,
        role,
        format_change(format_number(before), format_number(after)),
        f"{format_change(noise_ratio(before), noise_ratio(after))} × noise",
        "unchanged" if before == after else "no gap" if closed is None else format_percent(closed),
        *_angle_texts(curves, rig),
    )


def _angle_texts(curves: Curves, rig: TwinRig) -> tuple[str, str]:
    """Return angle and displacement of both models."""
    before = rope_angle_error(curves.residual_before_g[curves.used], rig)
    after = rope_angle_error(curves.residual_after_g[curves.used], rig)
    if before is None or after is None:
        return NOT_DETERMINED, NOT_DETERMINED
    angle, displacement = (format_change(*each) for each in zip(before.texts, after.texts, strict=True))
    return angle, displacement
