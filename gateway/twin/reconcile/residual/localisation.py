"""Where a residual exceeds the noise: when, on which axis, in which band, by how many sigma."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import periodogram
from gateway.numerics.stats import true_runs
from gateway.twin.reconcile.output.result import Disagreement

Array = NDArray[np.float64]
BLOCK_S = 5.0
"""Length of a block, about a period of the swing."""
MIN_BLOCK_SAMPLES = 11
"""Fewest samples of a block; a shorter one at the end is left out."""
MIN_BLOCK_RMS_SIGMA = 1.25
"""Rms of a block above which it exceeds the noise; noise of 100 samples does so once in 3600 blocks."""
BAND_POWER_SHARE = 0.8
"""Share of the power in the band that is reported."""


def localise_residual(time_s: Array, residual: Array) -> tuple[Disagreement, ...]:
    """Return the intervals, by axis, in which the blocks of a residual (n, 3) in sigma exceed the noise, largest first."""
    found: list[Disagreement] = []
    edges = np.searchsorted(time_s, np.arange(0, time_s[-1] + BLOCK_S, BLOCK_S))
    blocks = [(first, last) for first, last in pairwise(edges) if last - first >= MIN_BLOCK_SAMPLES]
    for axis, name in enumerate("xyz"):
        rms_sigma = [float(np.sqrt((residual[first:last, axis] ** 2).mean())) for first, last in blocks]
        for start, stop in true_runs([rms > MIN_BLOCK_RMS_SIGMA for rms in rms_sigma]):
            interval = slice(blocks[start][0], blocks[stop - 1][1])
            found.append(
                Disagreement(
                    axis=name,
                    from_s=float(time_s[interval.start]),
                    to_s=float(time_s[interval.stop - 1]),
                    band_hz=dominant_band_hz(time_s[interval], residual[interval][:, [axis]]),
                    rms_sigma=float(np.sqrt((residual[interval, axis] ** 2).mean())),
                )
            )
    return tuple(sorted(found, key=lambda each: -each.rms_sigma))


def dominant_band_hz(time_s: Array, residual: Array) -> tuple[float, float]:
    """Return the band of a residual (n, 1) that contains the middle `BAND_POWER_SHARE` of the power."""
    frequency_hz, power = periodogram(time_s, residual)
    share = np.cumsum(power[:, 0]) / max(float(power[:, 0].sum()), 1e-300)
    low, high = np.searchsorted(share, [(1 - BAND_POWER_SHARE) / 2, (1 + BAND_POWER_SHARE) / 2])
    return float(frequency_hz[low]), float(frequency_hz[min(high, len(frequency_hz) - 1)])
