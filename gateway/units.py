"""The one place where radians become degrees and nothing becomes nothing."""

import math


def degrees(angle_rad: float | None) -> float | None:
    """Degrees of an angle; None and NaN are None, never a stand-in."""
    if angle_rad is None or not math.isfinite(angle_rad):
        return None
    return math.degrees(angle_rad)


def finite(value: float | None) -> float | None:
    """The value, or None where it is not a number."""
    return None if value is None or not math.isfinite(value) else float(value)
