"""Small swings of a load on a rope: rate, period and length, and how the period grows with the amplitude."""

import math


def small_swing_rate_1_s(length_m: float, gravity_m_s2: float) -> float:
    """Return the angular frequency sqrt(g/L)."""
    return math.sqrt(gravity_m_s2 / length_m)


def small_swing_period_s(length_m: float, gravity_m_s2: float) -> float:
    """Return the period 2 pi sqrt(L/g)."""
    return 2 * math.pi * math.sqrt(length_m / gravity_m_s2)


def small_swing_length_m(rate_1_s: float, gravity_m_s2: float) -> float:
    """Return the length of the rope on which a small swing has this angular frequency."""
    return gravity_m_s2 / rate_1_s**2


def period_ratio(amplitude_rad: float) -> float:
    """Return the period of a planar swing over that of a small one to the fourth order (Nelson and Olsson 1986)."""
    squared = amplitude_rad**2
    return 1 + squared / 16 + 11 * squared**2 / 3072
