"""Gravity: the standard value, and the value at a place."""

import math

STANDARD_GRAVITY_M_S2 = 9.80665
"""Standard acceleration of gravity, the unit 1 g (CGPM 1901)."""


def normal_gravity_m_s2(latitude_deg: float, altitude_m: float) -> float:
    """Return gravity on the WGS 84 ellipsoid (Somigliana), less the free-air correction for the altitude."""
    sine_squared = math.sin(math.radians(latitude_deg)) ** 2
    on_ellipsoid = 9.7803253359 * (1 + 0.00193185265241 * sine_squared)
    return on_ellipsoid / math.sqrt(1 - 0.00669437999013 * sine_squared) - 3.086e-6 * altitude_m
