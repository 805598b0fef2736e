"""Means of samples over short bins: a fit sees a few hundred means where the recording has thousands of samples."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.swing.model.sensor_lowpass import delay_s, spread_s

BINS_PER_PERIOD = 32
"""Bins in the period of a small swing. Basis: the two-point quadrature leaves 1e-5 of a signal at twice the swing's frequency,
and the axial force swings at that frequency."""

SHARED_BINS = 4
"""Bins over which an error of quantisation is taken to be the same: an eighth of a period."""


@dataclass(frozen=True, slots=True)
class Bins:
    """Boxcar means, oldest first; all arrays of length n."""

    time_s: Array
    """Mean of the sample times in the bin."""
    spread_s: Array
    """Standard deviation of the sample times in the bin, see `quadrature_times_s`."""
    force_g: Array
    """Mean specific force, shape (n, 3)."""
    count: Array
    """Number of samples in the bin."""

    def __len__(self) -> int:
        return len(self.time_s)

    def quadrature_times_s(self) -> Array:
        """Return two times per bin, shape (2, n), at which the mean of a smooth signal is the bin's mean.

        This is two-point Gauss quadrature for the actual sample times, exact to third order. The attenuation by the boxcar is
        therefore part of the model and needs no correction.
        """
        return np.stack([self.time_s - self.spread_s, self.time_s + self.spread_s])

    def with_shared_error(self, ratio: float) -> "Bins":
        """Return the bins with the counts of independent samples, for an error over the noise that a few bins share."""
        return replace(self, count=self.count / (1 + SHARED_BINS * self.count * ratio**2))

    def select(self, chosen: slice | NDArray[np.bool_]) -> "Bins":
        """Return some of the bins."""
        return Bins(self.time_s[chosen], self.spread_s[chosen], self.force_g[chosen], self.count[chosen])

    def between(self, from_s: float, to_s: float) -> "Bins":
        """Return the bins whose time lies between two times."""
        return self.select((self.time_s >= from_s) & (self.time_s <= to_s))


def single_samples(time_s: Array, force_g: Array, bandwidth_hz: float | None = None) -> Bins:
    """Return samples, shape (n,) and (n, 3), as bins of one; a sensor's low-pass delays and spreads them."""
    count = np.ones_like(time_s)
    return Bins(time_s - delay_s(bandwidth_hz), spread_s(bandwidth_hz) * count, force_g, count)


def bin_samples(time_s: Array, force_g: Array, width_s: float, bandwidth_hz: float | None = None) -> Bins:
    """Average samples, shape (n,) and (n, 3), over bins that end at whole multiples of `width_s`; times must not fall."""
    return merge(single_samples(time_s, force_g, bandwidth_hz), width_s)


def merge(fine: Bins, width_s: float) -> Bins:
    """Average bins over wider ones; the result is that of binning the samples at once."""
    if len(fine) == 0:
        return fine
    label = np.floor(fine.time_s / width_s)
    first = np.flatnonzero(np.concatenate([[True], label[1:] != label[:-1]]))
    count = np.add.reduceat(fine.count, first)
    time_s = np.add.reduceat(fine.count * fine.time_s, first) / count
    deviation_s = fine.time_s - np.repeat(time_s, np.diff(np.append(first, len(label))))
    variance_s2 = np.add.reduceat(fine.count * (deviation_s**2 + fine.spread_s**2), first) / count
    force_g = np.add.reduceat(fine.count[:, None] * fine.force_g, first, axis=0) / count[:, None]
    return Bins(time_s, np.sqrt(variance_s2), force_g, count)


def concatenate(earlier: Bins, later: Bins) -> Bins:
    """Return two sequences of bins as one."""
    return Bins(
        np.concatenate([earlier.time_s, later.time_s]),
        np.concatenate([earlier.spread_s, later.spread_s]),
        np.concatenate([earlier.force_g, later.force_g]),
        np.concatenate([earlier.count, later.count]),
    )


def validated_samples(time_s: Array, specific_force_g: Array) -> tuple[Array, Array]:
    """Return the finite rows as float64. Raises `ValueError` for wrong shapes or falling times."""
    time_s, force_g = np.asarray(time_s, dtype=np.float64), np.asarray(specific_force_g, dtype=np.float64)
    if time_s.ndim != 1 or force_g.shape != (len(time_s), 3):
        raise ValueError(f"expected times (n,) and forces (n, 3), not {time_s.shape} and {force_g.shape}")
    usable = np.isfinite(time_s) & np.isfinite(force_g).all(axis=1)
    time_s, force_g = time_s[usable], force_g[usable]
    if (np.diff(time_s) < 0).any():
        raise ValueError("sample times fall: sort the samples, or remove the late ones")
    return time_s, force_g
