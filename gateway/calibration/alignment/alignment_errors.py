"""Errors of an alignment and of a calibration in a housing that is not square (Łuczak et al. 2022, eq. 1 to 3)."""

import math

HOUSING_DEVIATION_RAD = math.radians(0.01)
"""Deviation of perpendicularity of a machined steel housing, DP (Łuczak et al. 2022, sec. 2.1)."""


def alignment_precision_error_rad(variation_g: float) -> float:
    """Return APE, the angle that a remaining variation of plus or minus `variation_g` hides (eq. 1)."""
    return math.asin(min(abs(variation_g), 1.0))


def total_alignment_error_rad(precision_error_rad: float, housing_deviation_rad: float) -> float:
    """Return TAE, the sum of APE and the housing's deviation of perpendicularity (eq. 2)."""
    return precision_error_rad + housing_deviation_rad


def calibration_error_rad(housing_deviation_rad: float) -> float:
    """Return CE, the error of a six-position calibration by faces that are off by this angle (eq. 3)."""
    return math.asin(1 - math.cos(housing_deviation_rad))
