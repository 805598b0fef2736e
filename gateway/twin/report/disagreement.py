"""Where the nominal model and the data disagree: the residual in units of the noise."""

import numpy as np
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from gateway.documents.figures import AFTER, BEFORE, SHADE, Figure
from gateway.documents.format import format_number
from gateway.documents.plots import add_legend, add_panels, plot_curve, render_svg
from gateway.twin.reconcile.output.result import Curves, Disagreement, Reconciliation
from gateway.twin.report.gap_table import held_out_name
from gateway.twin.report.text import AXES, AXIS_NAMES, is_same_model, single_model_name

Array = NDArray[np.float64]


def disagreement_figures(result: Reconciliation) -> dict[str, object]:
    """Return the residual over time with the localised disagreements, and that of held-out data; None without a simulation."""
    if result.log is None:
        return {"figure": None, "held_out": None}
    name = single_model_name(result)
    held_out = None
    if result.held_out is not None:
        svg = residual_svg("held-out-residual", result.held_out, (), name)
        held_out = Figure(svg, f"The same for the {held_out_name(result)}.")
    figure = Figure(residual_svg("log-residual", result.log, result.disagreement, name))
    return {"figure": figure, "held_out": held_out, "axis_names": AXIS_NAMES}


def residual_sigma(measured_minus_simulated_g: Array, curves: Curves) -> Array:
    """Return the residual in units of the noise at the samples that count, shape (m, 3)."""
    found: Array = (measured_minus_simulated_g / curves.noise_g)[curves.used]
    return found


def residual_svg(name: str, curves: Curves, places: tuple[Disagreement, ...], single_model: str) -> str:
    """Return both residuals on three axes; `single_model` is the model's name where both are the same."""
    label = "Residual on three axes over time, in units of the noise"
    return render_svg(name, label, 4.6, lambda canvas: _draw(canvas, curves, places, single_model))


def _draw(canvas: Canvas, curves: Curves, places: tuple[Disagreement, ...], single_model: str) -> None:
    column = add_panels(canvas, gap=0.32)[:, 0]
    time_s = curves.recording_time_s[curves.used]
    models = [("before", residual_sigma(curves.residual_before_g, curves), BEFORE)]
    if is_same_model(curves):
        models = [(single_model, models[0][1], AFTER)]
    else:
        models.append(("after", residual_sigma(curves.residual_after_g, curves), AFTER))
    for row, axis in enumerate(AXES):
        axes = column[row]
        for i, each in enumerate(places, start=1):
            if each.axis == axis:
                axes.axvspan(each.from_s, each.to_s, facecolor=SHADE, alpha=0.35, edgecolor=SHADE, linewidth=0.8)
                axes.text(each.from_s, 0.97, f" {i}", transform=axes.get_xaxis_transform(), va="top", fontweight="bold")
        for label, residual, color in models:
            plot_curve(axes, time_s, residual[:, row], color, label if row == 0 else "", 0.7)
        axes.set_ylabel(f"{axis} (σ)")
        rms = " → ".join(format_number(float(np.sqrt(np.mean(residual[:, row] ** 2)))) for _, residual, _ in models)
        axes.set_title(f"{AXIS_NAMES[axis]}: rms {rms} σ", fontsize=8.5)
        for level in (-2, 2):
            axes.axhline(level, color="black", linewidth=0.7, linestyle=":")
    column[2].set_xlabel("time (s)")
    column[2].set_xlim(float(time_s[0]), float(time_s[-1]))
    add_legend(canvas)
