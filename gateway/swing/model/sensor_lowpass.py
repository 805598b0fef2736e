"""The low-pass inside a sensor: it delays each sample and averages it over a short past.

To second order in frequency over bandwidth a low-pass is described by two numbers, the delay and the spread (standard deviation)
of its impulse response. A swing at f is passed on by 1 - (2 pi f spread)^2/2. A single pole of bandwidth b has both equal to
1/(2 pi b); a moving average repeated a few times has 0.68 of that squared spread, a second-order Butterworth filter has none.
"""

from math import pi, sqrt

SQUARED_SPREAD_RATIO = 0.75
"""Squared spread over that of a single pole. Basis: between the 0.68 of repeated moving averages and the 1 of a single pole, the
shapes that sensors have."""
SQUARED_SPREAD_RATIO_U = 0.4
"""Standard uncertainty of that ratio. Basis: the range of the shapes, and 20 % for the tolerance of a stated bandwidth."""


def delay_s(bandwidth_hz: float | None) -> float:
    """Return the delay of a reading; 0 where no low-pass is stated."""
    return 0.0 if bandwidth_hz is None else 1 / (2 * pi * bandwidth_hz)


def spread_s(bandwidth_hz: float | None) -> float:
    """Return the standard deviation of the impulse response."""
    return sqrt(SQUARED_SPREAD_RATIO) * delay_s(bandwidth_hz)


def angle_u_rel(bandwidth_hz: float | None, period_s: float) -> float:
    """Return the relative standard uncertainty that the low-pass leaves in an angle after the correction.

    The axial force swings at 2 f with the square of the angle: four times the attenuation, half of it in the angle. This bound is
    used for every position of the housing.
    """
    return SQUARED_SPREAD_RATIO_U * (2 * pi * delay_s(bandwidth_hz) / period_s) ** 2
