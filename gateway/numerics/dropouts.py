"""Dropouts: rows in which a logger wrote zeros because it had no reading."""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

MAX_DROPOUT_SHARE = 0.05
"""Largest share of the rows. Basis: a choice; more zeros are a sensor that does not work, which is told as such."""
MIN_NEIGHBOUR_SHARE = 0.5
"""Norm of the rows around zeros over the median norm. Basis: a load in free fall reads little before it reads zero."""


def find_dropouts(readings: Array) -> NDArray[np.bool_]:
    """Return which rows of (n, 3) are zero in all axes though the rows around them read a weight, shape (n,)."""
    norm = np.linalg.norm(readings, axis=1)
    zero = norm == 0
    present = np.flatnonzero(~zero)
    if not 0 < zero.sum() <= MAX_DROPOUT_SHARE * len(zero):
        return np.zeros(len(zero), dtype=np.bool_)
    after = np.searchsorted(present, np.arange(len(zero)))
    before = norm[present[np.maximum(after - 1, 0)]]
    beyond = norm[present[np.minimum(after, len(present) - 1)]]
    has_weight = np.minimum(before, beyond) > MIN_NEIGHBOUR_SHARE * np.median(norm[present])
    return np.asarray(zero & has_weight, dtype=np.bool_)
