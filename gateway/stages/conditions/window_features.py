"""The features of a window that several gates use."""

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

from gateway.numerics.array import Array
from gateway.stages.conditions.window import Bin

STILL_SIGMA = 3.0
"""The smoothed means of a still housing vary by less than this many standard deviations of a bin, plus the floor. Basis: the
averages in a window of twenty independent bins exceed it by chance once in 2e4."""
BARE_STILL_SIGMA = 6.5
"""Limit of stillness for means that are not smoothed. Basis: twenty independent bins exceed it by chance once in 1300."""
STILL_FLOOR_G = 0.0005
"""Largest peak-to-peak value of a still housing: 0.015 degrees of lean in either direction. Basis: a choice; below a swing of any
use, and above the steps of a coarse sensor's mean."""
VIBRATION_LEAKAGE = 0.06
"""Share of the vibration that passes the smoothing. Basis: the mean over a second passes 0.06 of a line at 5.5 Hz, and less of
faster ones."""
SMOOTHED_BINS, ROUGH_SMOOTHED_BINS = 5, 10
"""Bins of the average, without vibration and with it. Basis: a choice; half a second and a second, short beside the swing."""
ROUGH_FACTOR = 4.0
"""A scatter within a bin of more than this many times the noise is vibration. Basis: a choice; noise alone does not scatter so,
and a running machine does."""
ROUGH_FLOOR_G = 0.004
"""Scatter within a bin from which on it is vibration, whatever the noise. Basis: a choice; above the noise of any supported
sensor, below any machine."""


@dataclass(frozen=True, slots=True)
class WindowFeatures:
    """The features of bins, oldest first, at least as many as are smoothed."""

    bins: list[Bin]
    means_g: Array
    """Shape (n, 3)."""
    noise_g: float
    """Noise as stated, or the scatter of the quietest bin."""
    scatter_g: float
    """Median scatter within a bin."""
    rough: bool
    """Whether at least one bin shows vibration."""
    smoothed_g: Array
    """Means after averaging of the vibration, shape (m, 3)."""
    still: bool
    """Whether the smoothed means are constant, and, without vibration, the means themselves, including the newest."""

    @classmethod
    def at(cls, bins: list[Bin], noise_g: float | None) -> "WindowFeatures":
        """`noise_g`: that of the device, None where it is not known."""
        means_g = np.array([b.mean_g for b in bins])
        scatters_g = [b.scatter_g for b in bins]
        noise_g = min(scatters_g) if noise_g is None else noise_g
        scatter_g, largest_g = median(scatters_g), max(scatters_g)
        rough = largest_g >= max(ROUGH_FACTOR * noise_g, ROUGH_FLOOR_G)
        smoothed_g = moving_average(means_g, ROUGH_SMOOTHED_BINS if rough else SMOOTHED_BINS)
        per_bin = sum(b.count for b in bins) / len(bins)
        u_mean_g = min(scatter_g, ROUGH_FLOOR_G) / math.sqrt(per_bin)
        leaking_g = VIBRATION_LEAKAGE * largest_g if rough else 0.0
        bare_g = 0.0 if rough else largest_range(means_g)
        still = bool(
            largest_range(smoothed_g) < STILL_FLOOR_G + STILL_SIGMA * u_mean_g + leaking_g
            and bare_g < STILL_FLOOR_G + BARE_STILL_SIGMA * u_mean_g
        )
        return cls(bins, means_g, noise_g, scatter_g, rough, smoothed_g, still)


def largest_range(values_g: Array) -> float:
    """Return the largest peak-to-peak value of the columns."""
    return float((values_g.max(axis=0) - values_g.min(axis=0)).max())


def moving_average(means_g: Array, width: int) -> Array:
    """Return the moving average over bins, shape (n - width + 1, 3)."""
    sums = np.zeros((len(means_g) + 1, 3))
    np.cumsum(means_g, axis=0, out=sums[1:])
    average: Array = (sums[width:] - sums[:-width]) / width
    return average
