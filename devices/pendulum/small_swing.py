"""Gravity, and the small swings of a load on a rope: rate, period and length, and how the period grows with the amplitude."""

import math

STANDARD_GRAVITY_M_S2 = 9.80665
"""Standard acceleration of gravity, the unit 1 g (CGPM 1901)."""


def normal_gravity_m_s2(latitude_deg: float, altitude_m: float) -> float:
    """Return gravity on the WGS 84 ellipsoid (Somigliana), less the free-air correction for the altitude."""
    sine_squared = math.sin(math.radians(latitude_deg)) ** 2
    on_ellipsoid = 9.7803253359 * (1 + 0.00193185265241 * sine_squared)
    return on_ellipsoid / math.sqrt(1 - 0.00669437999013 * sine_squared) - 3.086e-6 * altitude_m


MAX_MEANS_DIFFERENCE = 1e-12
"""Difference of the two means at which they are one. Definition: rounding."""
MIN_COSINE = 0.01
"""Least cosine of half an amplitude. Basis: a pendulum that reaches 180 degrees stays there, and its period has no bound."""


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
    """Return the period of a planar swing over that of a small one (Nelson and Olsson 1986).

    The complete elliptic integral, by the arithmetic-geometric mean of 1 and cos(amplitude/2); constant from 178.9 degrees on.
    """
    mean, other = 1.0, max(math.cos(amplitude_rad / 2), MIN_COSINE)
    while abs(mean - other) > MAX_MEANS_DIFFERENCE:
        mean, other = (mean + other) / 2, math.sqrt(mean * other)
    return 1 / mean
