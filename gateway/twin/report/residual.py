"""The residual in units of the noise: where the nominal model and the data disagree, and what the final model leaves."""

import numpy as np
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from gateway.documents.figures import AFTER, BEFORE, INK, SHADE, Figure
from gateway.documents.format import format_number
from gateway.documents.plots import add_legend, add_panels, label_decades, plot_curve, render_svg
from gateway.numerics.spectrum import periodogram
from gateway.twin.reconcile.output.result import Comparison, Curves, Disagreement, Reconciliation
from gateway.twin.report.gap import held_out_name
from gateway.twin.report.text import AXES, AXIS_NAMES, is_same_model, single_model_name

Array = NDArray[np.float64]


def disagreement_figures(result: Reconciliation, compared: Comparison) -> dict[str, object]:
    """Return the residual over time with the localised disagreements, and that of held-out data."""
    name = single_model_name(result)
    held_out = residual_svg("held-out-residual", compared.held_out, (), name)
    return {
        "figure": Figure(residual_svg("log-residual", compared.log, compared.disagreement, name)),
        "held_out": Figure(held_out, f"The same for the {held_out_name(compared)}."),
        "axis_names": AXIS_NAMES,
    }


def residual_svg(name: str, curves: Curves, places: tuple[Disagreement, ...], single_model: str) -> str:
    """Return both residuals on three axes; `single_model` is the model's name where both are the same."""
    label = "Residual on three axes over time, in units of the noise"
    return render_svg(name, label, 4.6, lambda canvas: _draw(canvas, curves, places, single_model))


def _draw(canvas: Canvas, curves: Curves, places: tuple[Disagreement, ...], single_model: str) -> None:
    column = add_panels(canvas, gap=0.32)[:, 0]
    time_s = curves.recording_time_s[curves.used]
    before, after = (each[curves.used] for each in curves.residuals_sigma)
    models = [("before", before, BEFORE), ("after", after, AFTER)]
    if is_same_model(curves):
        models = [(single_model, after, AFTER)]
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


BANDS = 240
LOWEST = 1e-2
"""Power below this share of white noise is not drawn. Basis: a choice; 20 dB below the noise."""
LOWEST_CYCLES = 0.99
"""Cycles in the recording of the lowest frequency that is drawn. Definition: one, but for rounding."""


def residual_figures(result: Reconciliation, compared: Comparison) -> dict[str, object]:
    """Return the residual of the final model over time, and its spectrum."""
    return {
        "residual": Figure(
            render_svg(
                "after-residual",
                "Residual of the final model over time",
                3.5,
                lambda canvas: _draw_residual(canvas, compared.log),
            ),
            "Residual of the final model on its own scale. Dotted: ±2 σ, which contains 95 % of the noise.",
        ),
        "spectrum": Figure(
            render_svg(
                "spectrum",
                "Power spectrum of the residual on three axes",
                5.0,
                lambda canvas: _draw_spectrum(canvas, result, compared),
            ),
            "Power spectrum of the residual over that of the noise, which lies around the line at 1. Dotted: the swing "
            "frequency and its double. Averaged over narrow bands; triangles mark spectral peaks.",
        ),
        "axis_names": AXIS_NAMES,
    }


def _draw_residual(canvas: Canvas, log: Curves) -> None:
    column = add_panels(canvas, share="all", top_margin_in=0.1)[:, 0]
    time_s, residual = log.recording_time_s[log.used], log.residuals_sigma[1][log.used]
    for row, axis in enumerate(AXES):
        plot_curve(column[row], time_s, residual[:, row], AFTER, width=0.5)
        column[row].set_ylabel(f"{axis} (σ)")
        for level in (-2, 2):
            column[row].axhline(level, color=INK, linewidth=0.7, linestyle=":")
    column[2].set_xlabel("time (s)")
    column[2].set_xlim(float(time_s[0]), float(time_s[-1]))


def _draw_spectrum(canvas: Canvas, result: Reconciliation, compared: Comparison) -> None:
    column = add_panels(canvas, share="all", gap=0.2)[:, 0]
    log, swing_hz = compared.log, 1 / result.rig.small_swing_period_s
    before, after = (periodogram(log.time_s, each) for each in log.residuals_sigma)
    models = [("before", before, BEFORE), ("after", after, AFTER)]
    if is_same_model(log):
        models = [(single_model_name(result), after, AFTER)]
    for row, axis in enumerate(AXES):
        axes = column[row]
        for label, (frequency_hz, power), color in models:
            # Lower ones are longer than the recording.
            resolved = frequency_hz * (log.time_s[-1] - log.time_s[0]) > LOWEST_CYCLES
            bands_hz, mean = decimate_spectrum(frequency_hz[resolved], power[resolved, row])
            axes.plot(bands_hz, np.maximum(mean, LOWEST), color=color, label=label if row == 0 else None)
        for peak in compared.residual.peaks:
            if peak.axis == axis:
                above = axes.get_xaxis_transform()
                axes.plot(peak.hz, 1.05, "v", color=INK, markersize=5, transform=above, clip_on=False)
        axes.axhline(1.0, color=INK, linewidth=0.9)
        for line_hz in (swing_hz, 2 * swing_hz):
            axes.axvline(line_hz, color=INK, linewidth=0.7, linestyle=":")
        axes.set_xscale("log")
        axes.set_yscale("log")
        label_decades(axes.xaxis)
        label_decades(axes.yaxis)
        axes.set_ylabel(f"{axis} (power/noise)")
    column[2].set_xlabel("frequency (Hz)")
    add_legend(canvas)


def decimate_spectrum(frequency_hz: Array, power: Array) -> tuple[Array, Array]:
    """Return means over bands of equal width on a logarithmic scale, of frequencies above zero; (m,) in, fewer out."""
    edges = np.geomspace(frequency_hz[0], frequency_hz[-1] * (1 + 1e-9), BANDS + 1)
    band = np.clip(np.searchsorted(edges, frequency_hz, side="right") - 1, 0, BANDS - 1)
    count = np.bincount(band, minlength=BANDS)
    filled = count > 0
    mean_hz = np.bincount(band, frequency_hz, BANDS)[filled] / count[filled]
    return mean_hz, np.bincount(band, power, BANDS)[filled] / count[filled]
