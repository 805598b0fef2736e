"""Decoding of samples of three 16-bit numbers."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from devices.accelerometer_chip import SampleRun

SAMPLE_BYTES = 6


def decode_samples(data: bytes, shift: int = 0) -> list[SampleRun]:
    """Return the samples of 6 n bytes: x, y, z in two's complement, little-endian, `shift` unused bits on the right.

    A sample of nothing but ones came from a bus that nobody drove, and is counted as lost.
    """
    words = np.frombuffer(data, dtype="<i2").reshape(-1, 3)
    counts = words.astype(np.int32) >> shift
    return split_runs(counts, ~(words == -1).all(axis=1))


def split_runs(
    counts: NDArray[np.int32], usable: NDArray[np.bool_], gyro_counts: NDArray[np.int32] | None = None
) -> list[SampleRun]:
    """Return the runs of usable samples, shape (n, 3), with the number of unusable ones before each."""
    if usable.all():
        return [SampleRun(counts, 0, gyro_counts)] if len(counts) else []
    edges = [0, *(np.flatnonzero(np.diff(usable)) + 1).tolist(), len(counts)]
    runs, lost = [], 0
    for first, end in pairwise(edges):
        if usable[first]:
            runs.append(SampleRun(counts[first:end], lost, None if gyro_counts is None else gyro_counts[first:end]))
            lost = 0
        else:
            lost = end - first
    return [*runs, SampleRun(counts[:0], lost)] if lost else runs
