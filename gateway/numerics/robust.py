"""Estimates that a few outliers do not change."""

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.stats import normal_quantile

MAD_TO_SIGMA = 1 / normal_quantile(0.75)
"""Standard deviation of a normal variable over its median absolute deviation, 1.4826. Definition: of a normal variable."""


def robust_sigma(deviations: Array) -> Array:
    """Return the standard deviation of each column of deviations (n, ...) from their centre, by the median of their size."""
    return np.asarray(MAD_TO_SIGMA * np.median(np.abs(deviations), axis=0), dtype=np.float64)
