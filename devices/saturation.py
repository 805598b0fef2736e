"""Readings at the end of what a part can output, whose true value may be larger."""

import numpy as np
from numpy.typing import NDArray


def mark_saturated(raw: NDArray[np.int32] | NDArray[np.float64], lowest: float, highest: float) -> NDArray[np.bool_]:
    """Return the samples of readings (n, 3) with an axis at or beyond a limit, shape (n,)."""
    if not len(raw) or (raw.min() > lowest and raw.max() < highest):
        return np.zeros(len(raw), dtype=np.bool_)
    return np.asarray(((raw <= lowest) | (raw >= highest)).any(axis=1), dtype=np.bool_)
