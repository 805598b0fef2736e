"""What the final model leaves: residual, spectrum, whiteness."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gateway.twin.reconcile.output.result import Curves, Peak, Reconciliation, Residual, Spectrum
from gateway.twin.report.disagreement import residual_sigma
from gateway.twin.report.drawing import curve, decades, drawn, legend, panels
from gateway.twin.report.markup import Html, element, illustration, joined, missing, paragraph, section, table
from gateway.twin.report.models import only_name, same
from gateway.twin.report.stretch import period_s
from gateway.twin.report.style import AFTER, BEFORE, INK
from gateway.twin.report.words import AXES, AXIS_WORDS, number, probability

Array = NDArray[np.float64]
BINS = 240
LOWEST = 1e-2
"""Power below this share of white noise is not drawn."""


def remaining_part(result: Reconciliation) -> Html:
    """Whether what is left is noise, and what it looks like if not."""
    title, name = "What is left after", "remaining"
    if result.residual is None:
        return section(title, missing("No model was fitted, so nothing is known of what remains."), name=name)
    return section(
        title,
        _whiteness(result.residual),
        _peaks(result.residual.peaks),
        _residual(result.log),
        _spectrum(result.residual, result),
        name=name,
    )


def _whiteness(residual: Residual) -> Html:
    p = probability(residual.ljung_box_p)
    if residual.white:
        text = "What is left looks like the sensor’s noise: no sample says anything about the next"
        return paragraph(element("strong", "White. "), f"{text} (Ljung-Box {p}).")
    text = "What is left is not mere noise: samples still say something about the next ones"
    return paragraph(element("strong", "Not white. ", class_="bad"), f"{text} (Ljung-Box {p}).")


def _peaks(peaks: tuple[Peak, ...]) -> Html:
    if not peaks:
        return paragraph("No single frequency stands out.")
    rows = (
        (f"{number(p.hz, 4)} Hz", AXIS_WORDS.get(p.axis, p.axis), f"{number(1e3 * p.amplitude_g)} mg") for p in peaks
    )
    return joined(
        [paragraph("Frequencies that stand out:"), table(("frequency", "axis", "amplitude"), rows, numbers=(2,))]
    )


def _residual(log: Curves | None) -> Html:
    if log is None:
        return missing("The residual was not kept.")
    picture = drawn("after-residual", "Residual after, over time", 3.5, lambda figure: _draw_residual(figure, log))
    return illustration(picture, "The residual after, on its own scale. Dotted: ±2 σ, where 95 % of noise stays.")


def _draw_residual(figure: Figure, log: Curves) -> None:
    column = panels(figure, share="all", above_in=0.1)[:, 0]
    time_s, residual = log.time_s[log.used], residual_sigma(log.residual_after_g, log)
    for row, axis in enumerate(AXES):
        curve(column[row], time_s, residual[:, row], AFTER, width=0.5)
        column[row].set_ylabel(f"{axis} (σ)")
        for level in (-2, 2):
            column[row].axhline(level, color=INK, linewidth=0.7, linestyle=":")
    column[2].set_xlabel("time (s)")
    column[2].set_xlim(float(time_s[0]), float(time_s[-1]))


def _spectrum(residual: Residual, result: Reconciliation) -> Html:
    spectrum = residual.spectrum
    if spectrum is None:
        return missing("The residual’s spectrum was not computed.")
    only = only_name(result) if result.log is not None and same(result.log) else None
    swing_hz = 1 / period_s(result)
    spectrum = _resolved(spectrum, result.log)
    picture = drawn(
        "spectrum",
        "Power spectrum of the residual on three axes",
        5.0,
        lambda figure: _draw_spectrum(figure, spectrum, residual.peaks, swing_hz, only),
    )
    return illustration(
        picture,
        "Spectrum of the residual: noise alone lies around the line at 1. Dotted: the swing’s frequency and twice that. "
        "Averaged over narrow bands; triangles mark the frequencies that stand out.",
    )


def _resolved(spectrum: Spectrum, log: Curves | None) -> Spectrum:
    """Without frequencies that the recording is too short to tell from zero."""
    lowest_hz = 0.0 if log is None else 1 / float(log.time_s[-1] - log.time_s[0])
    shown = spectrum.frequency_hz > 0.99 * lowest_hz
    return Spectrum(spectrum.frequency_hz[shown], spectrum.before[shown], spectrum.after[shown])


def _draw_spectrum(
    figure: Figure, spectrum: Spectrum, peaks: tuple[Peak, ...], swing_hz: float, only: str | None
) -> None:
    column = panels(figure, share="all", apart=0.2)[:, 0]
    models = [("before", spectrum.before, BEFORE), ("after", spectrum.after, AFTER)]
    if only is not None:
        models = [(only, spectrum.after, AFTER)]
    for row, axis in enumerate(AXES):
        axes = column[row]
        for label, power, color in models:
            frequency_hz, mean = banded(spectrum.frequency_hz, power[:, row])
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
        decades(axes.xaxis)
        decades(axes.yaxis)
        axes.set_ylabel(f"{axis} (power/noise)")
    column[2].set_xlabel("frequency (Hz)")
    legend(figure)


def banded(frequency_hz: Array, power: Array) -> tuple[Array, Array]:
    """Means over bands that are equally wide on a logarithmic scale; (m,) in, fewer out, zero frequency left out."""
    above = frequency_hz > 0
    frequency_hz, power = frequency_hz[above], power[above]
    edges = np.geomspace(frequency_hz[0], frequency_hz[-1] * (1 + 1e-9), BINS + 1)
    band = np.clip(np.searchsorted(edges, frequency_hz, side="right") - 1, 0, BINS - 1)
    count = np.bincount(band, minlength=BINS)
    filled = count > 0
    mean_hz = np.bincount(band, frequency_hz, BINS)[filled] / count[filled]
    return mean_hz, np.bincount(band, power, BINS)[filled] / count[filled]
