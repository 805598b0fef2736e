"""The figures of detail: acceleration around the peak, its spectrum, and the direction of the rope."""

import numpy as np
from matplotlib.figure import Figure as Canvas

from gateway.documents.figures import AFTER, BEFORE, EVENT, FAINT, Figure
from gateway.documents.plots import add_panels, label_decades, plot_curve, render_svg
from gateway.incident.course import Course, ForceCourse
from gateway.incident.facts import IncidentFacts
from gateway.incident.sample_gaps import broken_at
from gateway.incident.timeline_figure import ReportClock, hidden_caption, label_times, mark_hidden
from gateway.numerics.array import Array

AROUND_PEAK_S = 5.0
"""Time shown on either side of the peak. Basis: a choice; a swing of a long rope, and single blows still show."""
MAX_AXIS_POINTS = 4000
"""Points of each axis around the peak. Basis: every sample up to 400 Hz."""
AXIS_COLOURS = (("x", AFTER), ("y", BEFORE), ("z", "#009e73"))
STEP_PARTS = 10
"""Points of the polar plot from one message to the next. Basis: a choice; a curve without corners, at some messages per
second."""
SPECTRUM_BINS = 900
"""Bins that are drawn. Basis: more than the figure has pixels."""
MIN_SPECTRUM_SAMPLES = 64
"""Samples without which there is no spectrum. Basis: a choice; 32 lines."""
MAX_MISSING_SHARE = 0.05
"""Share of missing samples up to which there is a spectrum. Basis: a choice; missing ones are interpolated, which weakens a line
by some per cent."""
MIN_SHOWN_MG = 0.001
"""Lower end of the scale. Basis: a choice; below the noise of any sensor in a line."""


def acceleration_figure(course: Course, facts: IncidentFacts) -> Figure | None:
    """Return every sample within AROUND_PEAK_S of the largest angle; None where there is none."""
    clock = ReportClock(course)
    middle_s = _middle_s(course, facts)
    begin_s, end_s = max(course.begin_s, middle_s - AROUND_PEAK_S), min(course.end_s, middle_s + AROUND_PEAK_S)
    part = course.acceleration.between(begin_s, end_s)
    if not len(part.time_s):
        return None

    def draw(canvas: Canvas) -> None:
        panels = add_panels(canvas, gap=0.15, top_margin_in=0.1)[:, 0]
        for column, (axes, (name, colour)) in enumerate(zip(panels, AXIS_COLOURS, strict=True)):
            time_s, force_g = broken_at(course.hidden, part.time_s, part.force_g[:, column])
            plot_curve(axes, time_s, force_g, colour, points=MAX_AXIS_POINTS)
            axes.set_ylabel(f"{name}, g")
            axes.axvline(middle_s, color=EVENT, linewidth=0.9, linestyle=":")
            mark_hidden(axes, course)
            for change_s in (facts.raised_s, facts.cleared_s):
                if change_s is not None and begin_s < change_s < end_s:
                    axes.axvline(change_s, color="black", linewidth=0.9)
        label_times(panels[-1], clock, begin_s, end_s)

    rate = "" if course.samples.rate_hz is None else f" at {course.samples.rate_hz:.4g} Hz"
    return Figure(
        svg=render_svg("acceleration", "Specific force of x, y and z around the largest angle", 3.6, draw),
        caption=f"Every sample{rate} within {AROUND_PEAK_S:.0f} s of the largest angle (dotted), by the calibration in force. "
        "Specific force in the housing's axes: +1 g on the axis that points up at rest."
        f"{hidden_caption(course, begin_s, end_s)}",
    )


def spectrum_figure(course: Course, facts: IncidentFacts) -> Figure | None:
    """Return the amplitude spectrum of the incident; None for too few samples or too many missing."""
    begin_s, end_s = facts.begin_s, facts.end_s
    part = course.acceleration.between(begin_s, end_s)
    spectrum = _amplitude_spectrum(part)
    if spectrum is None:
        return None
    frequency_hz, amplitude_mg = spectrum
    whole = "this time" if facts.raised_s is None else "the incident"
    which = f"of {whole} that are in the recordings" if facts.angle.missing else f"from begin to end of {whole}"

    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots(gridspec_kw={"left": 0.11, "right": 0.985, "bottom": 0.17, "top": 0.97})
        for column, (name, colour) in enumerate(AXIS_COLOURS):
            axes.plot(frequency_hz, amplitude_mg[:, column], color=colour, linewidth=0.8, label=name)
        axes.set_xscale("log")
        axes.set_yscale("log")
        label_decades(axes.xaxis)
        label_decades(axes.yaxis)
        axes.set_xlabel("frequency, Hz")
        axes.set_ylabel("amplitude, mg")
        axes.set_xlim(frequency_hz[0], frequency_hz[-1])
        axes.set_ylim(bottom=max(MIN_SHOWN_MG, float(amplitude_mg.min())))
        axes.legend(loc="upper right", ncols=3)

    return Figure(
        svg=render_svg("spectrum", "Amplitude spectrum of the specific force of x, y and z", 2.6, draw),
        caption=f"Amplitude of a sine at each frequency, Hann window over the {end_s - begin_s:.1f} s "
        f"{which}, mean and trend removed.",
    )


def direction_figure(course: Course, facts: IncidentFacts) -> Figure | None:
    """Return angle and azimuth of the rope as a polar plot; None where they are not known."""
    motion = course.motion
    begin_s, end_s = facts.begin_s, facts.end_s
    inside = (motion.time_s >= begin_s) & (motion.time_s <= end_s) & np.isfinite(motion.angle_deg + motion.azimuth_deg)
    if np.count_nonzero(inside) < 2:
        return None
    azimuth_rad, angle_deg = np.radians(motion.azimuth_deg[inside]), motion.angle_deg[inside]

    def draw(canvas: Canvas) -> None:
        axes = canvas.add_axes((0.1, 0.08, 0.8, 0.84), projection="polar")
        axes.plot(*_through_the_middle(azimuth_rad, angle_deg), color=AFTER, linewidth=0.8)
        if facts.peak is not None and facts.peak.azimuth_deg is not None:
            axes.plot(np.radians(facts.peak.azimuth_deg), facts.peak.angle_deg, "o", color=EVENT, markersize=5)
        axes.set_xticks(np.radians([0, 45, 90, 135, 180, 225, 270, 315]))
        axes.set_xticklabels(["0° (x)", "45°", "90° (y)", "135°", "180°", "−135°", "−90°", "−45°"])
        axes.tick_params(axis="y", labelcolor=FAINT, labelsize=7.5)
        axes.yaxis.set_major_formatter(lambda value, _place: f"{value:g}°")

    return Figure(
        svg=render_svg("direction", "Polar plot of the rope's direction", 3.6, draw, 3.6),
        caption="The side to which the load hangs, seen from above, in the housing's axes; distance from the middle: the rope's "
        "angle. The dot is the largest angle.",
    )


def _middle_s(course: Course, facts: IncidentFacts) -> float:
    if facts.peak is not None:
        return facts.peak.time_s
    return (course.begin_s + course.end_s) / 2 if facts.raised_s is None else facts.raised_s


def _amplitude_spectrum(part: ForceCourse) -> tuple[Array, Array] | None:
    """Return frequencies (m,) in Hz and amplitudes (m, 3) in mg without the mean; None where they cannot be computed."""
    count = len(part.time_s)
    if count < MIN_SPECTRUM_SAMPLES or not np.isfinite(part.force_g).all():
        return None
    period_s = float(np.median(np.diff(part.time_s)))
    even_s = np.arange(part.time_s[0], part.time_s[-1], period_s)
    if not len(even_s) or len(even_s) - count > MAX_MISSING_SHARE * len(even_s):
        return None
    even_g = np.stack([np.interp(even_s, part.time_s, column) for column in part.force_g.T], axis=1)
    trend = np.polynomial.polynomial.polyfit(even_s - even_s[0], even_g, 1)
    even_g -= np.polynomial.polynomial.polyval(even_s - even_s[0], trend).T
    window = np.hanning(len(even_s))[:, None]
    amplitude_g = 2 * np.abs(np.fft.rfft(even_g * window, axis=0)) / window.sum()
    frequency_hz = np.asarray(np.fft.rfftfreq(len(even_s), period_s), dtype=np.float64)
    return _logarithmic_bins(frequency_hz[1:], np.asarray(1000 * amplitude_g[1:], dtype=np.float64))


def _logarithmic_bins(frequency_hz: Array, amplitude: Array) -> tuple[Array, Array]:
    """Return the largest amplitude of each bin of a logarithmic scale, at the bin's lowest frequency."""
    starts = np.unique(np.geomspace(1, len(frequency_hz), SPECTRUM_BINS).astype(int)) - 1
    return frequency_hz[starts], np.maximum.reduceat(amplitude, starts)


def _through_the_middle(azimuth_rad: Array, angle_deg: Array) -> tuple[Array, Array]:
    """Return a curve in polar coordinates whose jumps of the azimuth go straight across and not around the middle."""
    x, y = angle_deg * np.cos(azimuth_rad), angle_deg * np.sin(azimuth_rad)
    parts = max(1, min(STEP_PARTS, MAX_AXIS_POINTS // len(x)))
    steps = np.linspace(0, len(x) - 1, parts * (len(x) - 1) + 1)
    fine_x, fine_y = np.interp(steps, np.arange(len(x)), x), np.interp(steps, np.arange(len(y)), y)
    return np.unwrap(np.arctan2(fine_y, fine_x)), np.hypot(fine_x, fine_y)
