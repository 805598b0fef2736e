"""Figures of curves: measured and simulated specific force, and the residual in units of the noise and its spectrum."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from gateway.documents.figures import AFTER, BEFORE, CURVE_POINTS, EVENT, INK, LINE, MEASURED, SHADE, Figure
from gateway.documents.format import format_number, format_time_span, human_name, join_names
from gateway.documents.plots import add_legend, add_panels, label_decades, plot_curve, render_svg
from gateway.numerics.spectrum import periodogram
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.output.result import Comparison, Curves, Disagreement, NamedEffect, Reconciliation
from gateway.twin.report.gap import fitted_part_name, held_out_name
from gateway.twin.report.text import (
    AXES,
    AXIS_NAMES,
    NOMINAL,
    caution,
    final_model_name,
    is_same_model,
    single_model_name,
)

Array = NDArray[np.float64]
PERIODS = 3.0
"""Swing periods in a window."""
CYCLES = 12.0
"""Cycles in a window that shows an oscillation faster than the swing."""
FAST = 3.0
"""An oscillation above this many swing frequencies gets a window of its own cycles."""
NARROW = 2.0
"""A band wider than an octave has no cycles to show."""
MIN_SAMPLES = 40


def most_informative_window(result: Reconciliation, compared: Comparison, curves: Curves) -> tuple[float, float]:
    """Return from and to, in s of the recording."""
    acted = next((effect.when_s for effect in effects_acting_in(result, curves)), None)
    length_s = _length_s(result, compared, curves)
    if acted is not None:
        margin_s = length_s / 2
        return _within(curves, acted[0] - margin_s, acted[1] + margin_s)
    middle_s = _middle_s(curves, length_s, gained=shows_gain(result, curves))
    return _within(curves, middle_s - length_s / 2, middle_s + length_s / 2)


def shows_gain(result: Reconciliation, curves: Curves) -> bool:
    """Return whether the improvement is more informative than the residual: the model changed and explains the data."""
    return result.verdict != "unmodelled" and not is_same_model(curves)


def effects_acting_in(result: Reconciliation, curves: Curves) -> tuple[NamedEffect, ...]:
    """Return the transient effects that acted within the time of the curves.

    Times of effects count from the start of the recording, of which the curves may be a later part.
    """
    first_s, last_s = curves.span_s
    return tuple(
        effect
        for effect in result.effects
        if effect.when_s is not None and effect.when_s[0] < last_s and effect.when_s[1] >= first_s
    )


def _length_s(result: Reconciliation, compared: Comparison, curves: Curves) -> float:
    strongest = max(compared.disagreement, key=lambda each: each.rms_sigma, default=None)
    length_s = PERIODS * result.rig.small_swing_period_s
    if strongest is not None and _is_fast(strongest, result):
        length_s = CYCLES / strongest.band_hz[1]
    step_s = float(np.median(np.diff(curves.time_s)))
    return max(length_s, MIN_SAMPLES * step_s)


def _is_fast(disagreement: Disagreement, result: Reconciliation) -> bool:
    low_hz, high_hz = disagreement.band_hz
    return low_hz * result.rig.small_swing_period_s > FAST and high_hz < NARROW * low_hz


def _middle_s(curves: Curves, length_s: float, *, gained: bool) -> float:
    """Return the middle of the window in which the residual shrank most, or is largest after."""
    before, after = (each**2 for each in curves.residuals_sigma)
    wanted = (before - after if gained else after).sum(axis=1)
    samples = min(len(wanted), max(1, int(np.searchsorted(curves.time_s - curves.time_s[0], length_s))))
    sums = np.convolve(wanted, np.ones(samples), mode="valid")
    return float(curves.recording_time_s[int(np.argmax(sums)) + samples // 2])


def _within(curves: Curves, from_s: float, to_s: float) -> tuple[float, float]:
    """Return a window that is moved, not cut, at the ends of the curves."""
    first_s, last_s = curves.span_s
    length_s = min(to_s - from_s, last_s - first_s)
    from_s = min(max(from_s, first_s), last_s - length_s)
    return from_s, from_s + length_s


INSTANT = 0.01
"""An event shorter than this share of what is shown is drawn as a line."""


def motion_content(result: Reconciliation, compared: Comparison) -> dict[str, object]:
    """Return figures of the whole recording and its most informative window, and the same of held-out data."""
    what = f"{held_out_name(compared)} (only initial conditions and other parameters of the recording were fitted)"
    inputs = result.inputs if compared.held_out_is_last_third else result.held_out_inputs
    return {
        "caution": caution(result),
        "fitted": _figures(result, compared, compared.log, "log", fitted_part_name(compared), result.inputs),
        "held_out": _figures(result, compared, compared.held_out, "held-out", what, inputs),
    }


def _figures(
    result: Reconciliation,
    compared: Comparison,
    curves: Curves,
    name: str,
    what: str,
    inputs: tuple[EstimatedInput, ...],
) -> tuple[Figure, Figure]:
    first_s, last_s = curves.span_s
    from_s, to_s = most_informative_window(result, compared, curves)
    acting = effects_acting_in(result, curves)
    marked = f" Purple: when {join_names([effect.name for effect in acting])} acted." if acting else ""
    if any(_overlaps(each, first_s, last_s) for each in inputs):
        marked += " Grey: the crane worked, as estimated from the recording; these samples were not fitted."
    span, zoom_span = format_time_span(first_s, last_s), format_time_span(from_s, to_s)
    return (
        Figure(
            _svg(f"{name}-whole", result, curves, inputs, (first_s, last_s), box_s=(from_s, to_s)),
            f"The {what}, {span}. The box marks the window shown below.{marked}",
        ),
        Figure(
            _svg(f"{name}-zoom", result, curves, inputs, (from_s, to_s)),
            f"{zoom_span}: {_reason(result, curves)}.{marked}",
        ),
    )


def _overlaps(one: EstimatedInput, from_s: float, to_s: float) -> bool:
    return one.from_s < to_s and one.to_s > from_s


def _reason(result: Reconciliation, curves: Curves) -> str:
    """Return why a window is shown."""
    acting = effects_acting_in(result, curves)
    if acting:
        return f"the window in which {human_name(acting[0].name)} acted"
    largest = "improvement" if shows_gain(result, curves) else "residual"
    return f"the window with the largest {largest}"


def _svg(
    name: str,
    result: Reconciliation,
    curves: Curves,
    inputs: tuple[EstimatedInput, ...],
    window_s: tuple[float, float],
    box_s: tuple[float, float] | None = None,
) -> str:
    """Return the curves in a window, with the times at which the crane worked and events acted, and the box of another figure."""
    label = f"Specific force on three axes from {window_s[0]:.0f} s to {window_s[1]:.0f} s, measured and simulated"

    def draw(canvas: Canvas) -> None:
        for axes in _draw(canvas, result, curves, window_s):
            _mark_inputs(axes, inputs, window_s)
            _mark_effects(axes, effects_acting_in(result, curves), window_s)
            if box_s is not None:
                axes.axvspan(*box_s, facecolor="none", edgecolor=INK, linewidth=0.8)

    return render_svg(name, label, 4.6, draw)


def _draw(canvas: Canvas, result: Reconciliation, curves: Curves, window_s: tuple[float, float]) -> Iterator[Axes]:
    """Draw the models side by side; yield the axes of each panel before its curves."""
    models = [("before", curves.before_g, BEFORE), ("after", curves.after_g, AFTER)]
    if is_same_model(curves):
        models = [(single_model_name(result), curves.before_g, AFTER)]
    grid = add_panels(canvas, len(models), share="row")
    time_s = curves.recording_time_s
    shown = (time_s >= window_s[0]) & (time_s <= window_s[1]) & curves.used
    points = CURVE_POINTS // len(models)
    for column, (title, simulated_g, color) in enumerate(models):
        for row, axis in enumerate(AXES):
            axes = grid[row, column]
            yield axes
            plot_curve(axes, time_s[shown], curves.measured_g[shown, row], MEASURED, "measured", 1.5, points)
            plot_curve(axes, time_s[shown], simulated_g[shown, row], color, f"simulated, {title}", 0.9, points)
            axes.set_ylabel(f"{axis} (g)" if column == 0 else "")
        model = NOMINAL if column == 0 else final_model_name(result)
        grid[0, column].set_title("" if len(models) == 1 else f"{title}: {model}")
        grid[2, column].set_xlabel("time (s)")
        grid[2, column].set_xlim(*window_s)
    add_legend(canvas)


def _mark_inputs(axes: Axes, inputs: tuple[EstimatedInput, ...], window_s: tuple[float, float]) -> None:
    for one in inputs:
        if _overlaps(one, *window_s):
            span_s = max(one.from_s, window_s[0]), min(one.to_s, window_s[1])
            axes.axvspan(*span_s, facecolor=LINE, alpha=0.5, linewidth=0)


def _mark_effects(axes: Axes, acting: tuple[NamedEffect, ...], window_s: tuple[float, float]) -> None:
    for effect in acting:
        assert effect.when_s is not None
        from_s, to_s = effect.when_s
        axes.axvline(from_s, color=EVENT, linewidth=0.9, linestyle="--")
        if to_s - from_s > INSTANT * (window_s[1] - window_s[0]):
            axes.axvline(to_s, color=EVENT, linewidth=0.9, linestyle="--")
            axes.axvspan(from_s, to_s, facecolor=EVENT, alpha=0.12, linewidth=0)


def disagreement_figures(result: Reconciliation, compared: Comparison) -> dict[str, object]:
    """Return the residual over time with the localised disagreements, and that of held-out data."""
    held_out = residual_svg("held-out-residual", result, compared.held_out)
    return {
        "figure": Figure(residual_svg("log-residual", result, compared.log, compared.disagreement)),
        "held_out": Figure(held_out, f"The same for the {held_out_name(compared)}."),
        "axis_names": AXIS_NAMES,
    }


def _residuals(result: Reconciliation, curves: Curves) -> list[tuple[str, Array, str]]:
    """Return name, residual (n, 3) in sigma and colour of each model; of one where before and after are the same."""
    before, after = curves.residuals_sigma
    if is_same_model(curves):
        return [(single_model_name(result), after, AFTER)]
    return [("before", before, BEFORE), ("after", after, AFTER)]


def residual_svg(name: str, result: Reconciliation, curves: Curves, places: tuple[Disagreement, ...] = ()) -> str:
    """Return the residuals of both models on three axes, with the places of disagreements."""
    label = "Residual on three axes over time, in units of the noise"
    models = _residuals(result, curves)
    return render_svg(name, label, 4.6, lambda canvas: _draw_residuals(canvas, curves, models, places))


def _draw_residuals(
    canvas: Canvas,
    curves: Curves,
    models: list[tuple[str, Array, str]],
    places: tuple[Disagreement, ...] = (),
) -> None:
    column = add_panels(canvas, gap=0.32)[:, 0]
    used, time_s = curves.used, curves.recording_time_s[curves.used]
    for row, axis in enumerate(AXES):
        axes = column[row]
        for i, each in enumerate(places, start=1):
            if each.axis == axis:
                axes.axvspan(each.from_s, each.to_s, facecolor=SHADE, alpha=0.35, edgecolor=SHADE, linewidth=0.8)
                axes.text(each.from_s, 0.97, f" {i}", transform=axes.get_xaxis_transform(), va="top", fontweight="bold")
        for label, residual, color in models:
            plot_curve(axes, time_s, residual[used, row], color, label if row == 0 else "", 0.7)
        axes.set_ylabel(f"{axis} (σ)")
        rms = " → ".join(format_number(float(np.sqrt(np.mean(each[used, row] ** 2)))) for _, each, _ in models)
        axes.set_title(f"{AXIS_NAMES[axis]}: rms {rms} σ", fontsize=8.5)
        for level in (-2, 2):
            axes.axhline(level, color=INK, linewidth=0.7, linestyle=":")
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
    log, of_final = compared.log, [("after", compared.log.residuals_sigma[1], AFTER)]
    after = render_svg(
        "after-residual",
        "Residual of the final model over time",
        4.6,
        lambda canvas: _draw_residuals(canvas, log, of_final),
    )
    spectrum = render_svg(
        "spectrum",
        "Power spectrum of the residual on three axes",
        5.0,
        lambda canvas: _draw_spectrum(canvas, result, compared),
    )
    return {
        "residual": Figure(
            after, "Residual of the final model on its own scale. Dotted: ±2 σ, which contains 95 % of the noise."
        ),
        "spectrum": Figure(
            spectrum,
            "Power spectrum of the residual over that of the noise, which lies around the line at 1. Dotted: the swing "
            "frequency and its double. Averaged over narrow bands; triangles mark spectral peaks.",
        ),
        "axis_names": AXIS_NAMES,
    }


def _draw_spectrum(canvas: Canvas, result: Reconciliation, compared: Comparison) -> None:
    column = add_panels(canvas, share="all", gap=0.2)[:, 0]
    log, swing_hz = compared.log, 1 / result.rig.small_swing_period_s
    models = [(label, periodogram(log.time_s, each), color) for label, each, color in _residuals(result, log)]
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
