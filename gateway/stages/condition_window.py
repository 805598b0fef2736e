"""The last seconds of specific force as bins, and the features of this window that several gates use.

A bin has the mean, scatter and peak of its samples, and the number of clipped and missing ones.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median

import numpy as np

from gateway.numerics.array import Array

CONDITION_WINDOW_S = 2.0
"""Length of the window. Basis: a choice; a quarter of a swing of a rope of 16 m, and a verdict that is not late."""
SLOW_MEMORY_S = 6.0
"""Length of the memory, for slow movements that the window is too short to show. Basis: a choice; a half swing of a rope of 36 m,
and few hundred numbers."""
BIN_S = 0.1
"""Length of a bin. Basis: the period of the updates of the pipeline."""
COMPLETE_SHARE = 0.95
"""A bin is complete from this share of its length on. Basis: a choice; sample times jitter by less than 5 ms."""
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
class Bin:
    """A tenth of a second."""

    time_s: float
    """Middle of the bin."""
    mean_g: Array
    """Shape (3,)."""
    scatter_g: float
    peak_g: float
    """Largest distance of a sample from the mean, on any axis."""
    count: int
    clipped: int
    missing: int
    rate_rad_s: Array | None = None
    """Mean angular rate, shape (3,); None without a gyroscope."""


class ConditionWindow:
    """Collects blocks into bins and keeps those of the last seconds."""

    def __init__(self) -> None:
        self._bins: deque[Bin] = deque(maxlen=round(SLOW_MEMORY_S / BIN_S))
        self._open: list[Array] = []
        self._open_count = 0
        self._open_rates: list[Array] = []
        self._open_since_s: float | None = None
        self._last_s: float | None = None
        self._clipped = 0
        self._missing = 0

    def update(
        self, time_s: Array, force_g: Array, clipped: int, missing: int, rate_rad_s: Array | None = None
    ) -> None:
        """Add a block: times (n,), specific force (n, 3), numbers of clipped and missing samples, angular rates (n, 3)."""
        first_s = float(time_s[0])
        if self._last_s is not None and first_s - self._last_s > CONDITION_WINDOW_S:
            self._bins.clear()  # after a gap longer than the window the earlier bins are not relevant
            self._open, self._open_rates, self._open_count, self._open_since_s = [], [], 0, None
        elif self._follows_gap(first_s):
            self._close_bin()
        self._clipped += clipped
        self._missing += missing
        self._last_s = last_s = float(time_s[-1])
        if self._open_since_s is None:
            self._open_since_s = first_s
        self._open.append(force_g)
        self._open_count += len(force_g)
        if rate_rad_s is not None:
            self._open_rates.append(rate_rad_s[np.isfinite(rate_rad_s).all(axis=1)])
        count = self._open_count
        length_s = (last_s - self._open_since_s) * count / max(count - 1, 1)  # including the last sample's own period
        if length_s >= COMPLETE_SHARE * BIN_S:
            self._close_bin()

    @property
    def bins(self) -> list[Bin]:
        """The bins of the window, oldest first."""
        return list(self._bins)[-round(CONDITION_WINDOW_S / BIN_S) :]

    @property
    def memory(self) -> list[Bin]:
        """The bins of the longer memory, including the window."""
        return list(self._bins)

    def _follows_gap(self, first_s: float) -> bool:
        """Return whether a block begins after the open bin should be complete; one sample alone does not tell the rate."""
        return self._open_count > 1 and self._open_since_s is not None and first_s - self._open_since_s >= BIN_S

    def _close_bin(self) -> None:
        assert self._open_since_s is not None
        assert self._last_s is not None
        time_s = (self._open_since_s + self._last_s) / 2
        force_g = np.concatenate(self._open)
        count = self._open_count
        mean_g = np.add.reduce(force_g) / count
        away_g = force_g - mean_g
        scatter_g = math.sqrt(float(np.vdot(away_g, away_g)) / away_g.size)
        peak_g = float(max(away_g.max(), -away_g.min()))
        rate_rad_s = _mean_rate(self._open_rates)
        self._bins.append(Bin(time_s, mean_g, scatter_g, peak_g, count, self._clipped, self._missing, rate_rad_s))
        self._open, self._open_rates, self._open_count, self._open_since_s = [], [], 0, None
        self._clipped, self._missing = 0, 0


def _mean_rate(rates_rad_s: list[Array]) -> Array | None:
    """Return the mean of blocks of angular rates, shape (3,); None without a rate."""
    if not any(map(len, rates_rad_s)):
        return None
    mean: Array = np.concatenate(rates_rad_s).mean(axis=0)
    return mean


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
