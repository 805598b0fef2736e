"""The bins of a whole recording, as `Binning` makes them of a stream."""

import numpy as np
from numpy.typing import NDArray

from gateway.motion.binning import ROUNDING, ForceBin
from gateway.numerics.array import Array


def bin_recording(time_s: Array, force_g: Array, is_clipped: NDArray[np.bool_], width_s: float) -> list[ForceBin]:
    """Return the mean of the samples in each bin that has any; shapes (n,), (n, 3) and (n,), rising times."""
    if len(time_s) == 0:
        return []
    label = np.floor(time_s / width_s + ROUNDING)
    begin = np.flatnonzero(np.concatenate([[True], np.diff(label) != 0]))
    count = np.diff(np.concatenate([begin, [len(time_s)]]))
    mean_s = np.add.reduceat(time_s - time_s[0], begin) / count + time_s[0]
    mean_g = np.add.reduceat(force_g, begin, axis=0) / count[:, None]
    clipped = np.add.reduceat(is_clipped.astype(float), begin) > 0
    return [
        ForceBin(float(at), reading, int(number), bool(flag))
        for at, reading, number, flag in zip(mean_s, mean_g, count, clipped, strict=True)
    ]
