"""Where a model and the data part: when, on which axis, in which band, by how many sigma."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.runs import true_runs
from gateway.numerics.spectrum import periodogram
from gateway.twin.reconcile.output.result import Disagreement

Array = NDArray[np.float64]
BLOCK_S = 5.0
MIN_BLOCK_RMS_SIGMA = 1.25
"""Rms of a block, in sigma, from which it counts as parted."""
BAND_POWER_SHARE = 0.8


def localise_residual(time_s: Array, residual: Array) -> tuple[Disagreement, ...]:
    """Stretches of (n, 3) in sigma in which blocks are louder than noise, axis by axis."""
    found: list[Disagreement] = []
    edges = np.searchsorted(time_s, np.arange(0, time_s[-1] + BLOCK_S, BLOCK_S))
    blocks = [(a, b) for a, b in pairwise(edges) if b - a > 10]
    for axis, name in enumerate("xyz"):
        loud = [float(np.sqrt((residual[a:b, axis] ** 2).mean())) > MIN_BLOCK_RMS_SIGMA for a, b in blocks]
        for start, stop in true_runs(loud):
            part = slice(blocks[start][0], blocks[stop - 1][1])
            inside = residual[part, axis]
            found.append(
                Disagreement(
                    axis=name,
                    from_s=float(time_s[part.start]),
                    to_s=float(time_s[part.stop - 1]),
                    band_hz=dominant_band_hz(time_s[part], residual[part][:, [axis]]),
                    rms_sigma=float(np.sqrt((inside**2).mean())),
                )
            )
    return tuple(sorted(found, key=lambda each: -each.rms_sigma))


def dominant_band_hz(time_s: Array, residual: Array) -> tuple[float, float]:
    """Frequencies that hold the middle of the power, Hz."""
    frequency_hz, power = periodogram(time_s, residual)
    share = np.cumsum(power[:, 0]) / max(float(power[:, 0].sum()), 1e-300)
    low, high = np.searchsorted(share, [(1 - BAND_POWER_SHARE) / 2, (1 + BAND_POWER_SHARE) / 2])
    return float(frequency_hz[low]), float(frequency_hz[min(high, len(frequency_hz) - 1)])
