"""The amplitude of a swing, from the samples alone."""

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.numerics.spectrum import periodogram

Array = NDArray[np.float64]
LARGE_AMPLITUDE_RAD = 0.45
"""Amplitude beyond which a fit needs initial conditions from the samples: one that starts at rest does not converge."""
ASKEW_RAD = 0.17
"""Angle of the mean reading to the z axis from which the housing hangs askew: beyond the lean of a load in a strong wind."""
INITIAL_SHARE = 0.25
"""Share of the recording, from its start, that determines the amplitude. A short share shows a swing that decays; an event that
sets a load at rest in motion usually comes later."""
AXIAL_QUANTILE = 0.02
"""Quantile of the axial reading that stands for its value at the turning points, without the outliers of the noise."""
HALF_FREQUENCY_TOLERANCE = 0.4
"""Relative tolerance within which the swing's frequency is half that of the axial reading."""
TREND_DEGREE = 3
"""Degree of the polynomial that is taken off readings before their line is sought."""
MIN_SWING_POWER_SHARE = 0.1
"""Least share of the lateral power at the swing's frequency."""
SAME_FREQUENCY_RATIO = 1.15
"""Ratio of two frequencies up to which they are the same line."""
NEIGHBOUR_RATIO = 2.0
"""Ratio of frequencies within which a line is compared with its neighbours."""
MIN_LINE_TO_NEIGHBOURS = 30.0
"""Power over the median around it from which an axial line is a swing: noise alone gets there once in 10^9 frequencies."""
MIN_LINE_SHARE = 0.01
"""Power relative to the strongest axial line: a bounce may be stronger."""
MIN_RELATIVE_FREQUENCY = 0.2
"""Lowest frequency that counts, relative to the line's: slower is a drift."""
MIN_RISE_TO_FALL = 1.5
"""Rise of the axial reading above 1 g over its fall below, from which it is that of a swing: 2 rho for a housing at rho."""


def make_upright(force_g: Array) -> Array:
    """Return samples (n, 3) in axes whose z is the mean reading, where the housing hangs well askew; else the samples themselves.

    A load at rest would read 1 g along z then. The axes are turned about the line at right angles to both (Rodrigues).
    """
    used = force_g[np.isfinite(force_g).all(axis=1)]
    mean = used.mean(axis=0) / max(float(np.linalg.norm(used.mean(axis=0))), 1e-9)
    if mean[2] > np.cos(ASKEW_RAD) or mean[2] < 0:
        return force_g
    x, y, z = mean
    skew = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    upright: Array = force_g @ (np.eye(3) + skew + skew @ skew / (1 + z)).T
    return upright


def estimate_amplitude_rad(time_s: Array, force_g: Array, used: NDArray[np.bool_]) -> float:
    """Return the amplitude at the start of a recording: at a turning point the rope carries cos(amplitude) of the weight.

    This holds wherever the housing is on the rope. Of the samples (n, 3) only those in `used` (n,) count.
    """
    return local_amplitude_rad(force_g[used & _is_initial(time_s)])


def local_amplitude_rad(force_g: Array) -> float:
    """Return the amplitude of a swing in samples (n, 3) of about a period or more."""
    return float(np.arccos(np.clip(float(np.quantile(force_g[:, 2], AXIAL_QUANTILE)), -1.0, 1.0)))


def has_axial_reading_of_swing(time_s: Array, force_g: Array) -> bool:
    """Return whether the axial reading is that of a swing, and not of a load that bounces on the rope.

    The rope force of a swing has two minima per period, so the lateral readings have a line at half its frequency. Near the load,
    where they show no swing, the rope force rises twice as far above 1 g as it falls below, whereas a bounce is symmetric.
    """
    return _has_lateral_line(time_s, force_g) or _rises_further_than_it_falls(force_g[_is_initial(time_s), 2])


def has_axial_swing(time_s: Array, force_g: Array, small_swing_period_s: float) -> bool:
    """Return whether the axial reading has a line at twice the frequency of a swing with this period and its amplitude.

    It is strong beside the other lines of that reading, and stands out from the frequencies around it.
    """
    twice_hz = 2 / (small_swing_period_s * period_ratio(local_amplitude_rad(force_g)))
    windowed = (force_g - force_g.mean(axis=0)) * np.hanning(len(force_g))[:, None]
    frequency_hz, power = periodogram(time_s, windowed)
    band = frequency_hz > MIN_RELATIVE_FREQUENCY * twice_hz
    ratio, axial = np.abs(np.log(frequency_hz[band] / twice_hz)), power[band, 2]
    at_line, around = ratio < np.log(SAME_FREQUENCY_RATIO), ratio < np.log(NEIGHBOUR_RATIO)
    if not at_line.any():
        return False
    line = float(axial[at_line].max())
    return line > MIN_LINE_SHARE * axial.max() and line > MIN_LINE_TO_NEIGHBOURS * float(
        np.median(axial[around & ~at_line])
    )


def _rises_further_than_it_falls(axial_g: Array) -> bool:
    low_g, high_g = np.quantile(axial_g, [AXIAL_QUANTILE, 1 - AXIAL_QUANTILE])
    return bool(high_g - 1 > MIN_RISE_TO_FALL * (1 - low_g) > 0)


def _has_lateral_line(time_s: Array, force_g: Array) -> bool:
    initial, initial_s = force_g[_is_initial(time_s)], time_s[_is_initial(time_s)]
    # The axial reading of a swing that decays has a trend that may exceed its line.
    trend = np.polynomial.polynomial.polyvander(initial_s / max(float(initial_s[-1]), 1e-9), TREND_DEGREE)
    level = initial - trend @ np.linalg.lstsq(trend, initial, rcond=None)[0]
    _, power = periodogram(initial_s, level * np.hanning(len(initial))[:, None])
    half = np.argmax(power[:, 2]) / 2
    near = slice(int((1 - HALF_FREQUENCY_TOLERANCE) * half), int((1 + HALF_FREQUENCY_TOLERANCE) * half) + 1)
    lateral = power[:, :2].sum(axis=1)
    return bool(lateral[near].sum() > MIN_SWING_POWER_SHARE * lateral.sum())


def _is_initial(time_s: Array) -> NDArray[np.bool_]:
    initial: NDArray[np.bool_] = time_s <= INITIAL_SHARE * float(time_s[-1] - time_s[0])
    return initial
