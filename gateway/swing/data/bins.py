"""Samples averaged over short bins: the fit sees a few hundred means where the recording holds thousands of samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.swing.model.sensor_lowpass import delay_s, spread_s

Real = NDArray[np.float64]

BINS_PER_PERIOD = 32


@dataclass(frozen=True, slots=True)
class Bins:
    """Boxcar means, oldest first; all arrays of length n."""

    time_s: Real
    """Mean of the sample times in the bin."""
    spread_s: Real
    """Standard deviation of the sample times in the bin: what the model is averaged over, see `nodes_s`."""
    force_g: Real
    """Mean specific force, shape (n, 3)."""
    count: Real
    """Samples in the bin."""

    def __len__(self) -> int:
        return len(self.time_s)

    def nodes_s(self) -> Real:
        """Two times per bin, shape (2, n), over which a smooth signal has the bin's mean.

        Two-point Gauss quadrature for the samples' own times: exact to third order, so that the boxcar's attenuation is in
        the model instead of being corrected for. What remains is 1e-5 of the signal for bins of 1/16 of its period.
        """
        return np.stack([self.time_s - self.spread_s, self.time_s + self.spread_s])

    def select(self, chosen: slice | NDArray[np.bool_]) -> "Bins":
        """Some of the bins."""
        return Bins(self.time_s[chosen], self.spread_s[chosen], self.force_g[chosen], self.count[chosen])


def single_samples(time_s: Real, force_g: Real, bandwidth_hz: float | None = None) -> Bins:
    """Samples, shape (n,) and (n, 3), as bins of one each: a sensor's low-pass spreads and delays them."""
    count = np.ones_like(time_s)
    return Bins(time_s - delay_s(bandwidth_hz), spread_s(bandwidth_hz) * count, force_g, count)


def bin_samples(time_s: Real, force_g: Real, width_s: float, bandwidth_hz: float | None = None) -> Bins:
    """Average samples, shape (n,) and (n, 3), over bins that end at whole multiples of `width_s`; times must not fall."""
    return merge(single_samples(time_s, force_g, bandwidth_hz), width_s)


def merge(fine: Bins, width_s: float) -> Bins:
    """Average bins over wider ones, exactly as if the samples had been binned so at once."""
    if len(fine) == 0:
        return fine
    label = np.floor(fine.time_s / width_s)
    first = np.flatnonzero(np.concatenate([[True], label[1:] != label[:-1]]))
    count = np.add.reduceat(fine.count, first)
    time_s = np.add.reduceat(fine.count * fine.time_s, first) / count
    away_s = fine.time_s - np.repeat(time_s, np.diff(np.append(first, len(label))))
    variance_s2 = np.add.reduceat(fine.count * (away_s**2 + fine.spread_s**2), first) / count
    force_g = np.add.reduceat(fine.count[:, None] * fine.force_g, first, axis=0) / count[:, None]
    return Bins(time_s, np.sqrt(variance_s2), force_g, count)


def concatenate(earlier: Bins, later: Bins) -> Bins:
    """Two runs of bins as one."""
    return Bins(
        np.concatenate([earlier.time_s, later.time_s]),
        np.concatenate([earlier.spread_s, later.spread_s]),
        np.concatenate([earlier.force_g, later.force_g]),
        np.concatenate([earlier.count, later.count]),
    )


def checked(time_s: Real, specific_force_g: Real) -> tuple[Real, Real]:
    """The finite rows, as float64; raises ValueError for wrong shapes or falling times."""
    time_s, force_g = np.asarray(time_s, dtype=np.float64), np.asarray(specific_force_g, dtype=np.float64)
    if time_s.ndim != 1 or force_g.shape != (len(time_s), 3):
        raise ValueError(f"wanted times (n,) and forces (n, 3), not {time_s.shape} and {force_g.shape}")
    usable = np.isfinite(time_s) & np.isfinite(force_g).all(axis=1)
    time_s, force_g = time_s[usable], force_g[usable]
    if (np.diff(time_s) < 0).any():
        raise ValueError("sample times fall: sort them or leave the late ones out")
    return time_s, force_g
