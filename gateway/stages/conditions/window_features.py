"""A stretch of bins as the gates look at it: what several of them ask of it, worked out once."""

from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from gateway.stages.conditions.window import Bin

Array = NDArray[np.float64]
STILL_SIGMA = 3.0
"""A still housing keeps its smoothed bin means within this many standard deviations of a bin, beyond the floor."""
BARE_STILL_SIGMA = 6.5
"""The same of means that are not smoothed."""
STILL_FLOOR_G = 0.0005
"""Peak-to-peak that still counts as still: 0.015 degrees of lean either way."""
LEAKAGE = 0.06
"""Share of vibration that smoothing lets through."""
SMOOTHED_BINS, ROUGH_SMOOTHED_BINS = 5, 10
ROUGH_FACTOR = 4.0
"""Scatter within a bin of more than this many times the noise is vibration."""
ROUGH_FLOOR_G = 0.004


@dataclass(frozen=True, slots=True)
class WindowFeatures:
    """Bins, oldest first, at least as many as are smoothed."""

    bins: list[Bin]
    means_g: Array
    """Shape (n, 3)."""
    noise_g: float
    """As believed, or of the quietest bin."""
    scatter_g: float
    """Within a usual bin."""
    rough: bool
    """Something shakes in a bin at least."""
    smoothed_g: Array
    """Means with vibration averaged out, shape (m, 3)."""
    still: bool
    """Smoothed means stay where they are, and where nothing shakes the means themselves, the newest too."""

    @classmethod
    def at(cls, bins: list[Bin], noise_g: float | None) -> "WindowFeatures":
        """`noise_g`: of the device, None where it is not known."""
        means_g = np.array([b.mean_g for b in bins])
        scatters_g = [b.scatter_g for b in bins]
        noise_g = min(scatters_g) if noise_g is None else noise_g
        scatter_g, largest_g = median(scatters_g), max(scatters_g)
        rough = largest_g >= max(ROUGH_FACTOR * noise_g, ROUGH_FLOOR_G)
        smoothed_g = smoothed(means_g, ROUGH_SMOOTHED_BINS if rough else SMOOTHED_BINS)
        per_bin = sum(b.count for b in bins) / len(bins)
        u_mean_g = min(scatter_g, ROUGH_FLOOR_G) / np.sqrt(per_bin)
        leaking_g = LEAKAGE * largest_g if rough else 0.0
        bare_g = 0.0 if rough else np.ptp(means_g, axis=0).max()
        still = bool(
            np.ptp(smoothed_g, axis=0).max() < STILL_FLOOR_G + STILL_SIGMA * u_mean_g + leaking_g
            and bare_g < STILL_FLOOR_G + BARE_STILL_SIGMA * u_mean_g
        )
        return cls(bins, means_g, noise_g, scatter_g, rough, smoothed_g, still)


def smoothed(means_g: Array, width: int) -> Array:
    """Moving average over bins, shape (n - width + 1, 3)."""
    sums = np.cumsum(np.vstack([np.zeros(3), means_g]), axis=0)
    average: Array = (sums[width:] - sums[:-width]) / width
    return average
