"""Where the believed model and the data part: the residual in units of the noise."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gateway.twin.reconcile.output.result import Curves, Disagreement, Reconciliation
from gateway.twin.report.drawing import curve, drawn, legend, panels
from gateway.twin.report.markup import Html, illustration, joined, missing, paragraph, section, table
from gateway.twin.report.models import only_name, same
from gateway.twin.report.style import AFTER, BEFORE, SHADE
from gateway.twin.report.words import AXES, AXIS_WORDS, number

Array = NDArray[np.float64]
MOST = 12
"""Places in the table; all are shaded."""


def disagreement_part(result: Reconciliation) -> Html:
    """The residual over time with the located disagreements, then those as a table."""
    title, name = "Where simulation and measurement part", "disagreement"
    if result.log is None:
        return section(title, missing("No simulation was made, so there is no residual."), name=name)
    shading = " Shaded: the places in the table, where the model as believed is off." if result.disagreement else ""
    caption = (
        "Residual: measured − simulated, in units of the sensor’s noise σ. "
        "Noise alone stays mostly within the dotted lines, ±2 σ."
    )
    parts = [
        illustration(
            residual_picture("log-residual", result.log, result.disagreement, only_name(result)), caption, shading
        ),
        _table(result),
    ]
    if result.held_out is not None:
        held_out = residual_picture("held-out-residual", result.held_out, (), only_name(result))
        parts.append(illustration(held_out, f"The same on {_held_out(result)}."))
    return section(title, *parts, name=name)


def _held_out(result: Reconciliation) -> str:
    return "the last third, held out, time counted anew" if result.held_out_is_last_third else "the held-out recording"


def _table(result: Reconciliation) -> Html:
    if not result.disagreement:
        return paragraph("No place stands out: nowhere does the model as believed miss by more than noise would.")
    rows = (
        (
            str(i),
            AXIS_WORDS.get(each.axis, each.axis),
            f"{each.from_s:.1f} s to {each.to_s:.1f} s",
            f"{number(each.band_hz[0], 2)} to {number(each.band_hz[1], 2)} Hz",
            f"{number(each.rms_sigma)} σ",
        )
        for i, each in enumerate(result.disagreement[:MOST], start=1)
    )
    more = len(result.disagreement) - MOST
    listed = table(("no.", "axis", "when", "band", "misses by (rms)"), rows, numbers=(4,))
    return joined([listed, paragraph(f"… and {more} more.") if more > 0 else ""])


def residual_sigma(measured_minus_simulated_g: Array, curves: Curves) -> Array:
    """Residual in units of the noise at the samples that count, shape (m, 3)."""
    found: Array = (measured_minus_simulated_g / curves.noise_g)[curves.used]
    return found


def residual_picture(name: str, curves: Curves, places: tuple[Disagreement, ...], only: str) -> Html:
    """Before and after over each other, three axes; `only` is the model's name where both are the same."""
    label = "Residual on three axes over time, in units of the noise"
    return drawn(name, label, 4.6, lambda figure: _draw(figure, curves, places, only))


def _draw(figure: Figure, curves: Curves, places: tuple[Disagreement, ...], only: str) -> None:
    column = panels(figure, apart=0.32)[:, 0]
    time_s = curves.time_s[curves.used]
    models = [("before", residual_sigma(curves.residual_before_g, curves), BEFORE)]
    if same(curves):
        models = [(only, models[0][1], AFTER)]
    else:
        models.append(("after", residual_sigma(curves.residual_after_g, curves), AFTER))
    for row, axis in enumerate(AXES):
        axes = column[row]
        for i, each in enumerate(places, start=1):
            if each.axis == axis:
                axes.axvspan(each.from_s, each.to_s, facecolor=SHADE, alpha=0.35, edgecolor=SHADE, linewidth=0.8)
                axes.text(each.from_s, 0.97, f" {i}", transform=axes.get_xaxis_transform(), va="top", fontweight="bold")
        for label, residual, color in models:
            curve(axes, time_s, residual[:, row], color, label if row == 0 else "", 0.7)
        axes.set_ylabel(f"{axis} (σ)")
        rms = " → ".join(number(float(np.sqrt(np.mean(residual[:, row] ** 2)))) for _, residual, _ in models)
        axes.set_title(f"{AXIS_WORDS[axis]}: rms {rms} σ", fontsize=8.5)
        for level in (-2, 2):
            axes.axhline(level, color="black", linewidth=0.7, linestyle=":")
    column[2].set_xlabel("time (s)")
    column[2].set_xlim(float(time_s[0]), float(time_s[-1]))
    legend(figure)
