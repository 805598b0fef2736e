"""Detection of samples at full scale, whose true value may be larger."""

import numpy as np
from numpy.typing import NDArray

CLIPPED_SHARE = 0.998
"""A reading beyond this share of full scale is clipped."""


def count_clipped(readings: NDArray[np.int32] | NDArray[np.float64], full_scale: float | None) -> int:
    """Return the number of samples, shape (n, 3), with an axis at full scale, in the readings' unit; 0 where it is not known."""
    if full_scale is None:
        return 0
    limit = CLIPPED_SHARE * full_scale
    if -limit < readings.min() and readings.max() < limit:
        return 0
    return int(np.count_nonzero(np.abs(readings).max(axis=1) >= limit))
