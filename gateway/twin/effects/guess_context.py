"""What the initial guesses of an effect are computed from, and those of events and of oscillations.

A fit is not convex in times and frequencies: the times of events come from changepoints and scanned windows, frequencies from
spectral lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import hook_mass_ratio
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.numerics.spectrum import find_machine_line, find_strongest_line, fit_sine_phasors
from gateway.twin.effects.parameter import Values

Array = NDArray[np.float64]
SHARPEST = 0.01
"""The smallest fraction of an event in which it rises and falls. Basis: edges this sharp lie between two samples."""
RAMP_SHARES_BETWEEN_CHANGEPOINTS = (0.2, 0.28, 0.36)
"""Initial durations of each of the two ramps of a drive, over the time between the changepoints."""
RAMP_SHARE_IN_WINDOW = 0.25
"""The same for a scanned window."""
IMPACT_INTERVAL_S = 1.5
"""Longest time between the changepoints of an impact. Basis: each side needs half a second of samples."""
IMPACT_SPACING_S = 0.15
"""Spacing of the instants from which a fit finds an impact."""
OFF_GRID_S = 0.013
"""Shift that keeps the edges of an event between the samples."""
MIN_GUESS_S = 2.0
"""Shortest event that is guessed from a window."""
RIGGING_SHARES = (0.08, 0.13, 0.2, 0.27, 0.35, 0.45, 0.6)
"""Initial lengths of the rigging over the nominal length."""
HOOK_MASS_RATIOS = (0.01, 3.0)
"""Range of the initial mass of the hook block over that of the load."""
AMPLITUDE_CORRECTION = 1.01
"""Frequency of the fast mode of a small swing over the measured one: a large swing is slower."""
MODE_RATIO = (1.5, 12.0)
"""Range of the fast mode's frequency over the slow one's. Basis: closer lines belong to one swing whose amplitude changes."""
MIN_FAST_AMPLITUDE = 0.05
"""Smallest amplitude of the fast mode's line over the slow one's. Basis: overtones of a decaying swing are weaker."""
SWING_BAND_HZ = (0.03, 2.0)
"""Band of the swings of loads. Basis: ropes of 0.1 to 200 m."""
FIGURE_BAND_HZ = (0.025, 0.975)
"""Band, on both sides of zero, of the lines of the swing's figure x + i y."""
MIN_YAW_RATE_DEG_S = 0.3
"""Slowest rotation that needs a guess. Basis: a fit finds slower ones from zero."""
MIN_LINE_POWER = 100.0
"""Smallest power of an evident line over the noise floor around it."""
SECOND_MODE_FROM_HZ = 0.4
"""Lower end of the band of a main line that has overtones among the vibrations."""
OVERTONES = (2, 3, 4, 5)
"""Definition: multiples of the main line in the spectrum of large swings."""
OVERTONE_CYCLES = 3.0
"""Largest deviation of an overtone from the multiple, in cycles per recording. Basis: the main line moves as the swing decays."""
MAX_MAIN_LINE_RATIO = 10.0
"""Residual of the main line over that of a line below its last overtone, above which the line is no vibration."""


@dataclass(frozen=True, slots=True)
class EventWindow:
    """An interval outside which the load swings freely."""

    from_s: float
    to_s: float
    remaining_chi2: float
    """Chi-square with separate motions before and after the interval; samples inside it count as noise."""


@dataclass(frozen=True, slots=True)
class GuessContext:
    """A recording of n samples, the residual of the model so far, and the intervals in which an event may have acted."""

    length_m: float
    """Nominal length of the rope."""
    gravity_m_s2: float
    time_s: Array
    """Since the first sample, shape (n,)."""
    force_g: Array
    """Measured specific force, shape (n, 3)."""
    noise_g: Array
    """Standard deviation of the noise of each axis, shape (3,)."""
    residual_g: Array
    """Measured minus simulated by the model so far, shape (n, 3)."""
    windows: tuple[EventWindow, ...] = ()
    """Results of the changepoint scan, in order of increasing maximum length."""
    changepoints: EventWindow | None = None
    """The interval between the motion before an event and the motion after it; more reliable than the windows."""

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])


def guess_event(
    context: GuessContext, start: Sequence[str], durations: Sequence[str], edges: Sequence[str]
) -> list[Values]:
    """Return guesses for an event by the names of its parameters: for an instant, for a pulse, or for a sequence of parts."""
    if not durations:
        return [dict.fromkeys(start, values["start_s"]) for values in guess_impact(context)]
    found: list[Values] = []
    for pulse in guess_pulse(context):
        times: dict[str, float | tuple[float, ...]] = dict.fromkeys(start, pulse["start_s"])
        times |= {name: float(np.asarray(pulse["duration_s"])) / len(durations) for name in durations}
        times |= {name: pulse["rising_share"] for name in edges if "rising_share" in pulse}
        found += [times] if times not in found else []
    return found


def guess_impact(context: GuessContext) -> list[Values]:
    """Return instants around the changepoint, the nearest first, then the middles of the short windows."""
    found: list[Values] = []
    between = context.changepoints
    if between is not None and between.to_s - between.from_s < IMPACT_INTERVAL_S:
        at_s = np.arange(between.from_s - IMPACT_INTERVAL_S / 2, between.to_s, IMPACT_SPACING_S) + OFF_GRID_S
        nearest = np.argsort(np.abs(at_s - between.from_s), kind="stable")
        found = [{"start_s": float(each)} for each in at_s[nearest]]
    return found + [{"start_s": (w.from_s + w.to_s) / 2 + OFF_GRID_S} for w in context.windows[:2]]


def guess_pulse(context: GuessContext) -> list[Values]:
    """Return pulses between the changepoints with the usual and with sharp edges, and sharp ones in the windows."""
    sharp: list[Values] = [{**_pulse_in(window), "rising_share": SHARPEST} for window in context.windows[1:]]
    if context.changepoints is None:
        return sharp
    between = _pulse_in(context.changepoints)
    return [between, {**between, "rising_share": SHARPEST}, *sharp]


def guess_trapezoid(context: GuessContext) -> list[Values]:
    """Return drives of two ramps with constant speed between them: several between the changepoints, one in each window."""
    found = [_trapezoid_in(window, RAMP_SHARE_IN_WINDOW) for window in context.windows[2:]]
    if context.changepoints is None:
        return found
    return [_trapezoid_in(context.changepoints, share) for share in RAMP_SHARES_BETWEEN_CHANGEPOINTS] + found


def _trapezoid_in(window: EventWindow, ramp_share: float) -> Values:
    length_s = max(window.to_s - window.from_s, MIN_GUESS_S)
    return {
        "start_s": window.from_s + OFF_GRID_S,
        "duration_s": ramp_share * length_s,
        "coast_s": (1 - 2 * ramp_share) * length_s,
    }


def _pulse_in(window: EventWindow) -> Values:
    middle_s, length_s = (window.from_s + window.to_s) / 2, max(window.to_s - window.from_s, MIN_GUESS_S)
    return {"start_s": middle_s - length_s / 2 + OFF_GRID_S, "duration_s": length_s}


def guess_vibration(context: GuessContext) -> list[Values]:
    """Return the parameters of the strongest line above the pendulum's frequencies, unless it is an overtone."""
    line = find_machine_line(context.time_s, context.residual_g, context.noise_g)
    if line is None or _is_overtone(context, line.frequency_hz):
        return []
    return [vibration_values(line.frequency_hz, line.phasors_g)]


def _is_overtone(context: GuessContext, line_hz: float) -> bool:
    """Return whether a line is a multiple of the main line of the swing, since large swings are not sinusoidal.

    If the main line itself remains in the residual, its multiples may be split.
    """
    window = np.hanning(len(context.force_g))[:, None]
    transverse = (context.force_g - context.force_g.mean(axis=0)) * [1.0, 1.0, 0.0] * window / context.noise_g
    main = find_strongest_line(context.time_s, transverse, SECOND_MODE_FROM_HZ, SWING_BAND_HZ[1])
    if main is None or main.total < MIN_LINE_POWER:
        return False
    main_g, line_g = (
        np.linalg.norm(fit_sine_phasors(context.time_s, context.residual_g, hz)) for hz in (main.frequency_hz, line_hz)
    )
    if line_hz < OVERTONES[-1] * main.frequency_hz and main_g > MAX_MAIN_LINE_RATIO * line_g:
        return True
    off_hz = np.abs(line_hz - np.array(OVERTONES) * main.frequency_hz)
    return bool((off_hz < OVERTONE_CYCLES / context.duration_s).any())


def vibration_values(frequency_hz: float, phasors: NDArray[np.complex128]) -> Values:
    """Return the parameters of a vibration with phasors c of Re(c exp(i angle)), shape (3,).

    a sin(angle + phase - lag) is Re(c exp(i angle)) with c = a exp(i (phase - lag))/i.
    """
    phase, *others = (float(p) for p in wrap_angle(np.angle(phasors) + np.pi / 2))
    lags = tuple(float(lag) for lag in wrap_angle(phase - np.array(others)))
    amplitudes = tuple(float(a) for a in np.abs(phasors))
    return {"frequency_hz": frequency_hz, "amplitude_g": amplitudes, "lag_rad": lags, "phase_rad": phase}


def wrap_angle(angle_rad: Array) -> Array:
    """Return angles from -pi to pi."""
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi


def guess_double_pendulum(context: GuessContext) -> list[Values]:
    """Return rigging lengths and hook masses whose slow mode is near the nominal swing and whose fast mode is the line above.

    Either mode may be the stronger one. A line whose amplitude or frequency changes has flanks that exceed the line of the
    other mode: a window removes them except near the line, and each mode is searched in its own band.
    """
    time_s, transverse = context.time_s, context.force_g * [1.0, 1.0, 0.0] / context.noise_g
    between_hz = MODE_RATIO[0] * small_swing_rate_1_s(context.length_m, context.gravity_m_s2) / (2 * np.pi)
    slow_hz = _find_evident_line(time_s, transverse, SWING_BAND_HZ[0], between_hz)
    if slow_hz is None:
        return []
    slow_amplitude = np.linalg.norm(fit_sine_phasors(time_s, transverse, slow_hz))
    for hz in slow_hz * np.array([1.0, 2.0, 3.0]):
        phasors = fit_sine_phasors(time_s, transverse, hz)
        transverse = transverse - (phasors * np.exp(2j * np.pi * hz * time_s)[:, None]).real
    fast_hz = _find_evident_line(time_s, transverse, between_hz, SWING_BAND_HZ[1])
    if fast_hz is None or not MODE_RATIO[0] < fast_hz / slow_hz < MODE_RATIO[1]:
        return []
    if np.linalg.norm(fit_sine_phasors(time_s, transverse, fast_hz)) < MIN_FAST_AMPLITUDE * slow_amplitude:
        return []
    return [_with_fast_mode(context, share * context.length_m, fast_hz) for share in RIGGING_SHARES]


def _with_fast_mode(context: GuessContext, rigging_m: float, fast_hz: float) -> Values:
    """Return a rigging of this length with the hook's mass that gives the measured fast mode."""
    fast_rate_1_s = 2 * np.pi * AMPLITUDE_CORRECTION * fast_hz
    ratio = hook_mass_ratio(context.length_m - rigging_m, rigging_m, fast_rate_1_s, context.gravity_m_s2)
    return {"rigging_length_m": rigging_m, "hook_mass_ratio": float(np.clip(ratio, *HOOK_MASS_RATIOS))}


def _find_evident_line(time_s: Array, transverse: Array, from_hz: float, to_hz: float) -> float | None:
    """Return the frequency of the strongest line in a band, if it stands out."""
    windowed = (transverse - transverse.mean(axis=0)) * np.hanning(len(transverse))[:, None]
    line = find_strongest_line(time_s, windowed, from_hz, to_hz)
    return None if line is None or float(line.power[:2].sum()) < MIN_LINE_POWER else line.frequency_hz


def guess_yaw_rate(context: GuessContext) -> list[Values]:
    """Return the rate at which the figure of the swing turns in the housing's axes, and zero.

    x + i y of a swing has lines at +f and -f; a rotation moves both to one side.
    """
    figure = context.force_g[:, 0] + 1j * context.force_g[:, 1]
    transform = np.abs(np.fft.fft((figure - figure.mean()) * np.hanning(len(figure)), 8 * len(figure)))
    frequency_hz = np.fft.fftfreq(8 * len(figure), context.duration_s / (len(figure) - 1))
    peaks_hz = []
    for sign in (1, -1):
        side = (sign * frequency_hz > FIGURE_BAND_HZ[0]) & (sign * frequency_hz < FIGURE_BAND_HZ[1])
        peaks_hz.append(float(frequency_hz[side][np.argmax(transform[side])]))
    rate_deg_s = -180.0 * sum(peaks_hz)
    return [{"rate_deg_s": rate_deg_s}, {}] if abs(rate_deg_s) > MIN_YAW_RATE_DEG_S else [{}]
