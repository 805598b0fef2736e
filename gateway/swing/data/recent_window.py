"""The newest part of a live stream in bounded memory: fine bins for the fit, extremes for the published formulas."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins, concatenate, merge, single_samples, validated_samples
from gateway.swing.data.noise import effective_noise_g
from gateway.swing.formulas import Extremes, extremes

NOISE_MEMORY = 0.9
"""Weight of the previous noise variance when a new one is measured. Basis: averages ten updates, some three swings."""
NOISE_SAMPLES = 256
"""Newest samples from which the noise is measured. Basis: their standard deviation is known to 4 %."""


@dataclass(frozen=True, slots=True)
class _IntervalExtremes:
    """Extremes of the low-passed force between two updates."""

    end_s: float
    found: Extremes


class RecentWindow:
    """Takes blocks of samples and keeps the last `duration_s` of them as bins of `bin_s`."""

    def __init__(
        self, duration_s: float, bin_s: float, stated_noise_g: float | Array | None, bandwidth_hz: float | None = None
    ) -> None:
        self._duration_s, self._bin_s = duration_s, bin_s
        self._bandwidth_hz = bandwidth_hz
        self._stated_noise_g = stated_noise_g
        self._noise_g: Array | None = None
        self._newest_g: Array = np.empty((0, 3))
        self.clear()

    def clear(self) -> None:
        """Remove all samples; the noise stays, because it belongs to the sensor."""
        self._times_s: list[Array] = []
        self._forces_g: list[Array] = []
        self._intervals: list[_IntervalExtremes] = []
        self._lowpassed_g: list[Array] = []
        self.fine = Bins(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty(0))
        self.newest_s: float | None = None

    def push(self, time_s: Array, force_g: Array, lowpassed_g: Array | None) -> None:
        """Store a block; it is processed by the next `flush`."""
        self._times_s.append(time_s)
        self._forces_g.append(force_g)
        self.newest_s = float(time_s[-1])
        if lowpassed_g is not None:
            self._lowpassed_g.append(lowpassed_g)

    def flush(self) -> None:
        """Bin the stored blocks and drop what is too old. Raises `ValueError` for falling times."""
        if not self._times_s or self.newest_s is None:
            return
        time_s, force_g = validated_samples(np.concatenate(self._times_s), np.concatenate(self._forces_g))
        self._times_s, self._forces_g = [], []
        self._update_noise(force_g)
        fresh = single_samples(time_s, force_g, self._bandwidth_hz)
        merged = merge(concatenate(self.fine, fresh), self._bin_s)
        oldest_s = self.newest_s - self._duration_s
        self.fine = merged.select(merged.time_s >= oldest_s)
        found = extremes(np.concatenate(self._lowpassed_g)) if self._lowpassed_g else None
        if found is not None:
            self._intervals.append(_IntervalExtremes(self.newest_s, found))
        self._lowpassed_g = []
        self._intervals = [interval for interval in self._intervals if interval.end_s >= oldest_s]

    @property
    def noise_g(self) -> Array | None:
        """Noise for the weights of a fit, shape (3,); None before the first samples."""
        return self._noise_g

    def extremes_since(self, from_s: float) -> Extremes | None:
        """Return the extremes of the low-passed force after a time; None without samples."""
        found: Extremes | None = None
        for interval in self._intervals:
            if interval.end_s > from_s:
                found = interval.found if found is None else found.joined(interval.found)
        return found

    def _update_noise(self, force_g: Array) -> None:
        self._newest_g = np.concatenate([self._newest_g, force_g])[-NOISE_SAMPLES:]
        measured_g = effective_noise_g(self._newest_g, self._stated_noise_g)
        if self._noise_g is None:
            self._noise_g = measured_g
        else:
            self._noise_g = np.sqrt(NOISE_MEMORY * self._noise_g**2 + (1 - NOISE_MEMORY) * measured_g**2)
