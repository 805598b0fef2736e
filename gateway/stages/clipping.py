"""Detection of clipped samples, whose true value may be larger."""

import numpy as np
from numpy.typing import NDArray

CLIPPED_SHARE = 0.998
"""A reading beyond this share of full scale is clipped. Basis: a choice; below the rounding of a stated full scale, and no larger
share of the range is given up."""


def find_clipped(
    readings: NDArray[np.int32] | NDArray[np.float64],
    saturated: NDArray[np.bool_] | None,
    full_scale: float | None,
) -> NDArray[np.bool_]:
    """Return which samples of readings (n, 3) are clipped, shape (n,).

    `saturated`: as the device marks them; None: it does not, and `full_scale`, in the readings' unit, decides where it is known.
    """
    if saturated is not None:
        return saturated
    clipped = np.zeros(len(readings), dtype=np.bool_)
    if full_scale is None or not len(readings):
        return clipped
    limit = CLIPPED_SHARE * full_scale
    if -limit < readings.min() and readings.max() < limit:
        return clipped
    return np.asarray((np.abs(readings) >= limit).any(axis=1), dtype=np.bool_)
