"""Runs of consecutive samples with a property."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def true_runs(flags: Sequence[bool] | NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return each run of True as (index of its first element, index after its last)."""
    edges = np.diff(np.concatenate([[False], np.asarray(flags, dtype=bool), [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [(int(start), int(stop)) for start, stop in zip(starts, stops, strict=True)]
