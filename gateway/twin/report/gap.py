"""The gap, step by step and on each part of the data."""

import textwrap
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from gateway.documents.figures import AFTER, INK, MEASURED, Figure
from gateway.documents.format import format_number, human_name
from gateway.documents.plots import add_legend, label_decades, render_svg
from gateway.twin.reconcile.output.result import Gap, Reconciliation, Step
from gateway.twin.report.gap_table import MIN_TRANSVERSE_SENSITIVITY, part_rows, transverse_sensitivity
from gateway.twin.report.text import NOMINAL, caution, final_model_name, format_noise_ratio

LABEL_IN, LABEL_LETTERS = 1.45, 22
NARROW_IN = 5.0
"""Width of the narrow figure. Basis: it fits a phone without scrolling."""
LEAST_SHOWN = 0.05
SAME = 0.01
"""Relative: the last step's gap is the final one."""


@dataclass(frozen=True, slots=True)
class GapRow:
    """A model on the way, with its gap."""

    label: str
    log: float
    held_out: float | None


def gap_content(result: Reconciliation) -> dict[str, object]:
    """Return the figure, the gap on each part of the data, and what the housing's place shows of the rope's angle."""
    if result.gap is None:
        return {}
    sensitivity = transverse_sensitivity(result.rig)
    return {
        "figure": _figure(result, result.gap),
        "parts": part_rows(result),
        "sensitivity": sensitivity,
        "shows_angle": abs(sensitivity) >= MIN_TRANSVERSE_SENSITIVITY,
        "gain": _gain(result.gap),
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
    if elsewhere or not _is_same(rows[-1].log, gap.after_log):
        rows.append(GapRow(textwrap.fill(name, LABEL_LETTERS), gap.after_log, gap.after_held_out))
    elif rows[-1].held_out is None:
        rows[-1] = GapRow(rows[-1].label, rows[-1].log, gap.after_held_out)
    return rows


def _is_same(a: float, b: float) -> bool:
    return abs(a - b) <= SAME * abs(b)


def _step_label(added: frozenset[str], dropped: frozenset[str]) -> str:
    """Return what a step added and removed; effects found before the search are added in the first row."""
    changes = [f"+ {human_name(name)}" for name in sorted(added)] + [
        f"− {human_name(name)}" for name in sorted(dropped)
    ]
    return "\n".join(textwrap.fill(change, LABEL_LETTERS) for change in changes)


def _figure(result: Reconciliation, gap: Gap) -> Figure:
    rows = gap_rows(gap, result.steps, final_model_name(result), frozenset(result.model))
    svg = render_svg("gap", _row_label(rows), 0.9 + 0.5 * len(rows), lambda canvas: _draw(canvas, rows), NARROW_IN)
    caption = "Each row adds an effect to the model or removes one. The scale is logarithmic."
    return Figure(svg, f"{caption} {caution(result)}".rstrip())


def _row_label(rows: list[GapRow]) -> str:
    """Return the rows as text for screen readers."""
    return "Reduced chi-square: " + "; ".join(
        f"{' '.join(row.label.split())} {format_number(row.log)}"
        + (f", held-out {format_number(row.held_out)}" if row.held_out is not None else "")
        for row in rows
    )


def _draw(canvas: Canvas, rows: list[GapRow]) -> None:
    width, height = canvas.get_size_inches()
    margins = {"left": LABEL_IN / width, "right": 1 - 0.05 / width, "bottom": 0.48 / height, "top": 1 - 0.3 / height}
    axes = canvas.subplots(gridspec_kw=margins)
    evaluated = any(row.held_out is not None for row in rows)
    for i, row in enumerate(rows):
        _bar(axes, i - 0.19 if evaluated else i, row.log, AFTER, "data of the fit" if i == 0 else "")
        if evaluated:
            _bar(axes, i + 0.19, row.held_out, MEASURED, "held-out data" if i == 0 else "")
    shown = [value for row in rows for value in (row.log, row.held_out) if value is not None]
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


def _bar(axes: Axes, place: float, value: float | None, color: str, label: str) -> None:
    if value is None:
        axes.text(1.05, place, "not evaluated on held-out data", va="center", fontsize=7.5)
        return
    shown = max(value, LEAST_SHOWN)
    axes.barh(place, shown - 1.0, left=1.0, height=0.34, color=color, label=label or None)
    text = f"{format_number(value)}  ({format_noise_ratio(value)})"
    axes.text(max(shown, 1.0) * 1.06, place, text, va="center", fontsize=7.5)


def _gain(gap: Gap) -> str:
    if gap.before_test is None or gap.after_test is None:
        return "The model was not evaluated on data to which it was not fitted."
    if gap.before_test == gap.after_test:
        return "The gap is the same before and after."
    if gap.test_interval is None:
        return "The uncertainty of the gain on the test part was not computed."
    low, high = gap.test_interval
    return (
        f"On the test part the final model reduces the chi-square by {format_number(gap.before_test - gap.after_test)} "
        f"(95 % interval {format_number(low)} to {format_number(high)}, block bootstrap)."
    )
