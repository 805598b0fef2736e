"""Units of time and of memory, the conversion of radians to degrees, and of numbers that are not finite to None."""

import math

MINUTE_S, HOUR_S, DAY_S = 60, 3600, 86_400
HOURS_PER_DAY = 24
BYTES_PER_MB = 1_000_000


def degrees(angle_rad: float | None) -> float | None:
    """Return an angle in degrees; None for None and NaN."""
    if angle_rad is None or not math.isfinite(angle_rad):
        return None
    return math.degrees(angle_rad)


def finite(value: float | None) -> float | None:
    """Return the value; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)
