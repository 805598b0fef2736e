"""The residual in units of the noise: where the nominal model and the data disagree, and what the final model leaves."""

import numpy as np
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from gateway.documents.figures import AFTER, BEFORE, INK, SHADE, Figure
from gateway.documents.format import format_number
from gateway.documents.plots import add_legend, add_panels, label_decades, plot_curve, render_svg
from gateway.twin.reconcile.output.result import Curves, Disagreement, Peak, Reconciliation, Residual, Spectrum
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


BANDS = 240
LOWEST = 1e-2
"""Power below this share of white noise is not drawn. Basis: a choice; 20 dB below the noise."""


def residual_figures(result: Reconciliation) -> dict[str, object]:
    """Return the residual over time and its spectrum; None for what was not kept."""
    spectrum = None if result.residual is None else _spectrum_figure(result.residual, result)
    return {"residual": _residual_figure(result.log), "spectrum": spectrum, "axis_names": AXIS_NAMES}


def _residual_figure(log: Curves | None) -> Figure | None:
    if log is None:
        return None
    label = "Residual of the final model over time"
    svg = render_svg("after-residual", label, 3.5, lambda canvas: _draw_residual(canvas, log))
    return Figure(svg, "Residual of the final model on its own scale. Dotted: ±2 σ, which contains 95 % of the noise.")


def _draw_residual(canvas: Canvas, log: Curves) -> None:
    column = add_panels(canvas, share="all", top_margin_in=0.1)[:, 0]
    time_s, residual = log.recording_time_s[log.used], residual_sigma(log.residual_after_g, log)
    for row, axis in enumerate(AXES):
        plot_curve(column[row], time_s, residual[:, row], AFTER, width=0.5)
        column[row].set_ylabel(f"{axis} (σ)")
        for level in (-2, 2):
            column[row].axhline(level, color=INK, linewidth=0.7, linestyle=":")
    column[2].set_xlabel("time (s)")
    column[2].set_xlim(float(time_s[0]), float(time_s[-1]))


def _spectrum_figure(residual: Residual, result: Reconciliation) -> Figure | None:
    if residual.spectrum is None:
        return None
    single_model = single_model_name(result) if result.log is not None and is_same_model(result.log) else None
    swing_hz = 1 / result.rig.small_swing_period_s
    spectrum = _resolved(residual.spectrum, result.log)
    svg = render_svg(
        "spectrum",
        "Power spectrum of the residual on three axes",
        5.0,
        lambda canvas: _draw_spectrum(canvas, spectrum, residual.peaks, swing_hz, single_model),
    )
    return Figure(
        svg,
        "Power spectrum of the residual over that of the noise, which lies around the line at 1. Dotted: the swing frequency "
        "and its double. Averaged over narrow bands; triangles mark spectral peaks.",
    )


def _resolved(spectrum: Spectrum, log: Curves | None) -> Spectrum:
    """Return the spectrum without frequencies that the recording is too short to resolve."""
    lowest_hz = 0.0 if log is None else 1 / float(log.time_s[-1] - log.time_s[0])
    shown = spectrum.frequency_hz > 0.99 * lowest_hz
    return Spectrum(spectrum.frequency_hz[shown], spectrum.before[shown], spectrum.after[shown])


def _draw_spectrum(
    canvas: Canvas, spectrum: Spectrum, peaks: tuple[Peak, ...], swing_hz: float, single_model: str | None
) -> None:
    column = add_panels(canvas, share="all", gap=0.2)[:, 0]
    models = [("before", spectrum.before, BEFORE), ("after", spectrum.after, AFTER)]
    if single_model is not None:
        models = [(single_model, spectrum.after, AFTER)]
    for row, axis in enumerate(AXES):
        axes = column[row]
        for label, power, color in models:
            frequency_hz, mean = decimate_spectrum(spectrum.frequency_hz, power[:, row])
            axes.plot(frequency_hz, np.maximum(mean, LOWEST), color=color, label=label if row == 0 else None)
        for peak in peaks:
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
    """Return means over bands of equal width on a logarithmic scale; (m,) in, fewer out, without frequency zero."""
    above = frequency_hz > 0
    frequency_hz, power = frequency_hz[above], power[above]
    edges = np.geomspace(frequency_hz[0], frequency_hz[-1] * (1 + 1e-9), BANDS + 1)
    band = np.clip(np.searchsorted(edges, frequency_hz, side="right") - 1, 0, BANDS - 1)
    count = np.bincount(band, minlength=BANDS)
    filled = count > 0
    mean_hz = np.bincount(band, frequency_hz, BANDS)[filled] / count[filled]
    return mean_hz, np.bincount(band, power, BANDS)[filled] / count[filled]
