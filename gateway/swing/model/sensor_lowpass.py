"""What the low-pass inside a sensor does to a swing: it smears each sample over a short past.

To second order in frequency over bandwidth every low-pass is known by two numbers, the delay and the spread of its impulse
response: a swing at f is passed on by 1 - (2 pi f spread)^2/2. A single pole of bandwidth b has both equal to 1/(2 pi b); a
moving average repeated a few times has 0.68 of the squared spread, a second-order Butterworth none.
"""

from math import pi, sqrt

SQUARED_SPREAD = 0.75
"""Of a single pole's: between the shapes that sensors have,"""
SQUARED_SPREAD_U = 0.4
"""and its standard uncertainty, the tolerance of the stated bandwidth included."""


def delay_s(bandwidth_hz: float | None) -> float:
    """By how much a reading is older than its time says; 0 where no low-pass is stated."""
    return 0.0 if bandwidth_hz is None else 1 / (2 * pi * bandwidth_hz)


def spread_s(bandwidth_hz: float | None) -> float:
    """Standard deviation of the impulse response."""
    return sqrt(SQUARED_SPREAD) * delay_s(bandwidth_hz)


def angle_u_rel(bandwidth_hz: float | None, period_s: float) -> float:
    """Relative standard uncertainty that remains in an angle after the correction.

    The axial force swings at 2 f with the square of the angle: four times the attenuation, half of it in the angle. That is
    taken for every mounting.
    """
    return SQUARED_SPREAD_U * (2 * pi * delay_s(bandwidth_hz) / period_s) ** 2
