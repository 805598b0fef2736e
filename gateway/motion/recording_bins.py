"""The bins of a whole recording, as `Binning` makes them of a stream."""

import numpy as np
from numpy.typing import NDArray

from gateway.motion.binning import ROUNDING, ForceBin
from gateway.numerics.array import Array


def bin_recording(
    time_s: Array, force_g: Array, is_clipped: NDArray[np.bool_], width_s: float, rate_rad_s: Array | None = None
) -> list[ForceBin]:
    """Return the mean of the samples in each bin that has any; shapes (n,), (n, 3) and (n,), rising times.

    `rate_rad_s`: angular rates, shape (n, 3), NaN where a sample has none; None without a gyroscope.
    """
    if len(time_s) == 0:
        return []
    label = np.floor(time_s / width_s + ROUNDING)
    begin = np.flatnonzero(np.concatenate([[True], np.diff(label) != 0]))
    count = np.diff(np.concatenate([begin, [len(time_s)]]))
    mean_s = np.add.reduceat(time_s - time_s[0], begin) / count + time_s[0]
    mean_g = np.add.reduceat(force_g, begin, axis=0) / count[:, None]
    clipped = np.add.reduceat(is_clipped.astype(float), begin) > 0
    rates: list[Array | None] = [None] * len(begin)
    if rate_rad_s is not None:
        means_rad_s = np.add.reduceat(rate_rad_s, begin, axis=0) / count[:, None]
        rates = [mean if np.isfinite(mean).all() else None for mean in means_rad_s]
    return [
        ForceBin(float(at), reading, int(number), bool(flag), rate)
        for at, reading, number, flag, rate in zip(mean_s, mean_g, count, clipped, rates, strict=True)
    ]
