"""How the gap shrank, step by step."""

import textwrap
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gateway.twin.reconcile.output.result import Gap, Reconciliation, Step
from gateway.twin.report.drawing import decades, drawn, legend
from gateway.twin.report.markup import Html, illustration, missing, paragraph, section
from gateway.twin.report.models import BELIEVED, caution, final_name, fitted_part
from gateway.twin.report.style import AFTER, INK, MEASURED
from gateway.twin.report.words import number, plain, times_noise

LABEL_IN, LABEL_LETTERS = 1.45, 22
NARROW_IN = 5.0
"""Fits a phone without scrolling."""
LEAST_SHOWN = 0.05
SAME = 0.01
"""Relative: the last step's gap is the final one."""
HELD_OUT = "held-out recording (not fitted to)"
LAST_THIRD = "its last third (not fitted to)"


@dataclass(frozen=True, slots=True)
class Row:
    """A model on the way, with its gap."""

    label: str
    log: float
    held_out: float | None


def gap_part(result: Reconciliation) -> Html:
    """The bars and how to read them."""
    title, name = "The gap, step by step", "gap"
    if result.gap is None:
        return section(title, missing("No model was fitted, so there is no gap to show."), name=name)
    rows = rows_of(result.gap, result.steps, final_name(result), frozenset(result.model))
    held_out = LAST_THIRD if result.held_out_is_last_third else HELD_OUT
    picture = drawn(
        "gap",
        _spoken(rows),
        0.9 + 0.5 * len(rows),
        lambda figure: _draw(figure, rows, fitted_part(result), held_out),
        NARROW_IN,
    )
    return section(
        title,
        paragraph(
            "The gap is the reduced chi-square: the mean square of measured − simulated, in units of the sensor’s noise. "
            "1 is noise alone; 100 means that the simulation misses by ten times the noise."
        ),
        illustration(
            picture, f"Each row adds an effect to the model or drops one. The scale is logarithmic. {caution(result)}"
        ),
        _interval(result.gap),
        name=name,
    )


def rows_of(gap: Gap, steps: tuple[Step, ...], name: str, effects: frozenset[str]) -> list[Row]:
    """From the model as believed over every step to the model after, of that name and with these effects.

    The last step leads elsewhere where held-out data preferred another model, or one of several that fit as well is shown.
    """
    rows = [Row(BELIEVED, gap.before_log, gap.before_held_out)]
    names: frozenset[str] = frozenset()
    for step in steps:
        label = _label(frozenset(step.names) - names, names - frozenset(step.names))
        if label:
            rows.append(Row(label, step.gap_log, step.gap_held_out))
        names = frozenset(step.names)
    elsewhere = len(rows) > 1 and not names <= effects
    if elsewhere or not _alike(rows[-1].log, gap.after_log):
        rows.append(Row(textwrap.fill(name, LABEL_LETTERS), gap.after_log, gap.after_held_out))
    elif rows[-1].held_out is None:
        rows[-1] = Row(rows[-1].label, rows[-1].log, gap.after_held_out)
    return rows


def _alike(a: float, b: float) -> bool:
    return abs(a - b) <= SAME * abs(b)


def _label(added: frozenset[str], dropped: frozenset[str]) -> str:
    """What the row before had not, and what it had; what was found before the search is added in the first row."""
    changes = [f"+ {plain(name)}" for name in sorted(added)] + [f"− {plain(name)}" for name in sorted(dropped)]
    return "\n".join(textwrap.fill(change, LABEL_LETTERS) for change in changes)


def _spoken(rows: list[Row]) -> str:
    return "Reduced chi-square: " + "; ".join(
        f"{' '.join(row.label.split())} {number(row.log)}"
        + (f", held-out {number(row.held_out)}" if row.held_out is not None else "")
        for row in rows
    )


def _draw(figure: Figure, rows: list[Row], fitted: str, held_out: str) -> None:
    width, height = figure.get_size_inches()
    margins = {"left": LABEL_IN / width, "right": 1 - 0.05 / width, "bottom": 0.48 / height, "top": 1 - 0.3 / height}
    axes = figure.subplots(gridspec_kw=margins)
    judged = any(row.held_out is not None for row in rows)
    for i, row in enumerate(rows):
        _bar(axes, i - 0.19 if judged else i, row.log, AFTER, fitted if i == 0 else "")
        if judged:
            _bar(axes, i + 0.19, row.held_out, MEASURED, held_out if i == 0 else "")
    shown = [value for row in rows for value in (row.log, row.held_out) if value is not None]
    axes.set_xscale("log")
    decades(axes.xaxis)
    axes.set_xlim(min(0.7, *shown, 0.7), max(10.0, *shown) ** 1.6)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_yticks(range(len(rows)), [row.label for row in rows])
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    axes.axvline(1.0, color=INK, linewidth=1.0)
    axes.set_xlabel("gap: reduced chi-square of the residual (1 = noise alone)")
    legend(figure)


def _bar(axes: Axes, place: float, value: float | None, color: str, label: str) -> None:
    if value is None:
        axes.text(1.05, place, "not judged on held-out data", va="center", fontsize=7.5)
        return
    shown = max(value, LEAST_SHOWN)
    axes.barh(place, shown - 1.0, left=1.0, height=0.34, color=color, label=label or None)
    axes.text(max(shown, 1.0) * 1.06, place, f"{number(value)}  ({times_noise(value)})", va="center", fontsize=7.5)


def _interval(gap: Gap) -> Html:
    if gap.before_held_out is None or gap.after_held_out is None:
        return missing("The model was not judged on data that it had not seen.")
    if gap.before_held_out == gap.after_held_out:
        return paragraph("The gap is the same before and after.")
    if gap.held_out_interval is None:
        return missing("How sure the gain on held-out data is was not computed.")
    low, high = gap.held_out_interval
    return paragraph(
        f"On data that it was not fitted to, the model after takes {number(gap.before_held_out - gap.after_held_out)} off the "
        f"reduced chi-square (95 % interval {number(low)} to {number(high)}, from whole blocks of the recording drawn again)."
    )
