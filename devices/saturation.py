"""Readings at the end of what a part can output, whose true value may be larger."""

import numpy as np
from numpy.typing import NDArray

GYRO_END_OF_RANGE = 32767
"""A count of an angular rate at or beyond it is no rate. Basis: gyroscopes of 16 bits."""


def code_limits(bits: int) -> tuple[int, int]:
    """Return the lowest and the highest number of two's complement."""
    return -(1 << (bits - 1)), (1 << (bits - 1)) - 1


def mark_saturated(raw: NDArray[np.int32] | NDArray[np.float64], lowest: float, highest: float) -> NDArray[np.bool_]:
    """Return the samples of readings (n, 3) with an axis at or beyond a limit, shape (n,)."""
    if not len(raw) or (raw.min() > lowest and raw.max() < highest):
        return np.zeros(len(raw), dtype=np.bool_)
    return np.asarray(((raw <= lowest) | (raw >= highest)).any(axis=1), dtype=np.bool_)


def angular_rates(counts: NDArray[np.int32], per_count: float) -> NDArray[np.float64]:
    """Return angular rates, shape (n, 3), in the unit of `per_count`; NaN at the end of the range."""
    return np.where(np.abs(counts) < GYRO_END_OF_RANGE, counts * per_count, np.nan)
