"""Names and numbers that only the report prints."""

import math

from gateway.documents.format import format_number

AXES = ("x", "y", "z")
AXIS_NAMES = {"x": "x, across the rope", "y": "y, across the rope", "z": "z, along the rope"}


def noise_ratio(chi2: float) -> str:
    """Return the rms of a residual in standard deviations of the noise, from its reduced chi-square."""
    return format_number(math.sqrt(max(chi2, 0.0)))


def format_noise_ratio(chi2: float) -> str:
    """Return the rms of a residual as a multiple of the noise: `4.18 × noise`."""
    return f"{noise_ratio(chi2)} × noise"


def format_change(before: str, after: str) -> str:
    """Return `15.2 → 0.995`, or one value where both are the same."""
    return before if before == after else f"{before} → {after}"
