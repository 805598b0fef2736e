"""Initial guesses from spectra: a fit is not convex in frequencies, so the frequencies come from spectral lines."""

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import hook_mass_ratio
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.numerics.spectrum import find_machine_line, find_strongest_line, fit_sine_phasors
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Values

Array = NDArray[np.float64]
BOUNCE_HZ = (0.5, 8.0)
"""Band of the oscillation of loads along their ropes."""
MIN_BOUNCE_POWER = 30.0
"""Power of an oscillation along the rope over the noise floor around it. Basis: a choice; it decays, so its line is broad and
low, and a third of that of an evident line."""
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
    phase, *others = (float(p) for p in _wrap_angle(np.angle(phasors) + np.pi / 2))
    lags = tuple(float(lag) for lag in _wrap_angle(phase - np.array(others)))
    amplitudes = tuple(float(a) for a in np.abs(phasors))
    return {"frequency_hz": frequency_hz, "amplitude_g": amplitudes, "lag_rad": lags, "phase_rad": phase}


def _wrap_angle(angle_rad: Array) -> Array:
    found: Array = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return found


def guess_bounce(context: GuessContext) -> list[Values]:
    """Return the frequency of the strongest line of the axial residual, if it stands out."""
    axial = context.residual_g * [0.0, 0.0, 1.0] / context.noise_g
    line = find_strongest_line(context.time_s, axial, *BOUNCE_HZ)
    return [] if line is None or line.power[2] < MIN_BOUNCE_POWER else [{"frequency_hz": line.frequency_hz}]


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
