"""Quantiles of the normal, Student and chi-square distributions."""

import math
from statistics import NormalDist

import numpy as np

_STANDARD_NORMAL = NormalDist()
_QUADRATURE_NODES, _QUADRATURE_WEIGHTS = np.polynomial.legendre.leggauss(32)
"""Basis: a choice; 32 nodes integrate the density of any degree of freedom in use to rounding."""


def normal_quantile(probability: float) -> float:
    """Return the value that a standard normal variable stays below with this probability."""
    return _STANDARD_NORMAL.inv_cdf(probability)


NORMAL_975 = normal_quantile(0.975)
"""Definition: coverage factor of a two-sided 95 % interval of a normal variable."""
CHANCE_LEVEL = 0.99
"""Probability with which stated uncertainties alone keep chi-square below its limit. Basis: a choice; one sound calibration in a
hundred is called in question."""


def student_quantile(probability: float, freedom: float) -> float:
    """Return the value that Student's t stays below with this probability, at least 1/2; `freedom` need not be whole.

    With t = sqrt(freedom) tan(angle) the density becomes a power of a cosine. Its integral is concave in the angle, so Newton's
    method from 0 approaches the solution from below.
    """
    scale = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(math.pi)
    angle, step = 0.0, math.inf
    while step > 1e-12:
        nodes = angle / 2 * (1 + _QUADRATURE_NODES)
        below = scale * angle / 2 * float(_QUADRATURE_WEIGHTS @ np.cos(nodes) ** (freedom - 1))
        step = (probability - 0.5 - below) / (scale * math.cos(angle) ** (freedom - 1))
        angle += step
    return math.sqrt(freedom) * math.tan(angle)


def chi_square_quantile(probability: float, freedom: float) -> float:
    """Return the value that chi-square stays below with this probability (Wilson and Hilferty 1931)."""
    variance = 2 / (9 * freedom)
    return freedom * (1 - variance + normal_quantile(probability) * math.sqrt(variance)) ** 3
