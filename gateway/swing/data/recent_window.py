"""The recent past of a live stream in bounded memory: fine bins for the fit, extremes for the formulas."""

from dataclasses import dataclass

import numpy as np

from gateway.swing.data.bins import Bins, checked, concatenate, merge, single_samples
from gateway.swing.data.noise import believed_noise_g
from gateway.swing.formulas import Extremes, extremes
from gateway.swing.model.spherical_pendulum import Real

NOISE_MEMORY = 0.9
"""Share of the old noise that stays when a new one is seen."""
NOISE_SAMPLES = 256


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Extremes of the low-passed force between two looks."""

    end_s: float
    found: Extremes


class RecentWindow:
    """Takes blocks; keeps `keep_s` of them as bins of `width_s`."""

    def __init__(
        self, keep_s: float, width_s: float, stated_noise_g: float | Real | None, bandwidth_hz: float | None = None
    ) -> None:
        self._keep_s, self._width_s = keep_s, width_s
        self._bandwidth_hz = bandwidth_hz
        self._stated_noise_g = stated_noise_g
        self._noise_g: Real | None = None
        self._tail_g: Real = np.empty((0, 3))
        self.clear()

    def clear(self) -> None:
        """Forget all samples (the noise stays: it is the sensor's)."""
        self._times_s: list[Real] = []
        self._forces_g: list[Real] = []
        self._stretches: list[_Stretch] = []
        self._lowpassed_g: list[Real] = []
        self.fine = Bins(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty(0))
        self.newest_s: float | None = None

    def push(self, time_s: Real, force_g: Real, lowpassed_g: Real | None) -> None:
        """Put a block aside, which costs next to nothing; it is looked at when the window is settled."""
        self._times_s.append(time_s)
        self._forces_g.append(force_g)
        self.newest_s = float(time_s[-1])
        if lowpassed_g is not None:
            self._lowpassed_g.append(lowpassed_g)

    def flush(self) -> None:
        """Bin what was put aside and drop what is too old. Raises ValueError for times that fall."""
        if not self._times_s or self.newest_s is None:
            return
        time_s, force_g = checked(np.concatenate(self._times_s), np.concatenate(self._forces_g))
        self._times_s, self._forces_g = [], []
        self._see_noise(force_g)
        fresh = single_samples(time_s, force_g, self._bandwidth_hz)
        merged = merge(concatenate(self.fine, fresh), self._width_s)
        self.fine = merged.select(merged.time_s >= self.newest_s - self._keep_s)
        found = extremes(np.concatenate(self._lowpassed_g)) if self._lowpassed_g else None
        if found is not None:
            self._stretches.append(_Stretch(self.newest_s, found))
        self._lowpassed_g = []
        self._stretches = [s for s in self._stretches if s.end_s >= self.newest_s - self._keep_s]

    @property
    def noise_g(self) -> Real | None:
        """Noise to reckon with, shape (3,); None before the first samples."""
        return self._noise_g

    def extremes_since(self, from_s: float) -> Extremes | None:
        """Extremes of the low-passed force after `from_s`."""
        found: Extremes | None = None
        for stretch in self._stretches:
            if stretch.end_s > from_s:
                found = stretch.found if found is None else found.joined(stretch.found)
        return found

    def _see_noise(self, force_g: Real) -> None:
        self._tail_g = np.concatenate([self._tail_g, force_g])[-NOISE_SAMPLES:]
        seen_g = believed_noise_g(self._tail_g, self._stated_noise_g)
        if self._noise_g is None:
            self._noise_g = seen_g
        else:
            self._noise_g = np.sqrt(NOISE_MEMORY * self._noise_g**2 + (1 - NOISE_MEMORY) * seen_g**2)
