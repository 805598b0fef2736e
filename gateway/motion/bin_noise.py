"""The noise of the bins, measured from the bins themselves: vibration counts as noise, slow motion does not."""

import numpy as np

from gateway.numerics.array import Array

DIFFERENCE_GAIN_SQUARED = 20.0
"""Definition: variance of a third difference over that of a bin (1 + 9 + 9 + 1)."""
MEMORY = 0.98
"""Weight of the earlier variance at each bin. Basis: averages fifty bins, some five seconds."""
LARGEST_JUMP = 30.0
"""One bin counts at most as this many times the variance so far. Basis: an impact of one bin is no vibration."""


class BinNoise:
    """Standard deviation of a bin's mean on each axis, at least as large as stated."""

    def __init__(self) -> None:
        self._bins: list[Array] = []
        self._variance_g2: Array | None = None

    def clear(self) -> None:
        """Forget the newest bins, as after a gap; the noise stays."""
        self._bins = []

    @property
    def is_known(self) -> bool:
        """Whether the noise has been measured."""
        return self._variance_g2 is not None

    def add(self, force_g: Array) -> None:
        """Take the reading of a bin, shape (3,), without what is modelled as a fast oscillation."""
        self._bins = [*self._bins[-3:], force_g]
        if len(self._bins) < 4:
            return
        a, b, c, d = self._bins
        squared = (d - 3 * c + 3 * b - a) ** 2 / DIFFERENCE_GAIN_SQUARED
        squared[:2] = 0.5 * (squared[0] + squared[1])
        if self._variance_g2 is None:
            self._variance_g2 = squared
        else:
            limited = np.minimum(squared, LARGEST_JUMP * self._variance_g2)
            self._variance_g2 = MEMORY * self._variance_g2 + (1 - MEMORY) * limited

    def sigma_g(self, stated_g: float) -> Array:
        """Return the standard deviation of a bin, shape (3,), at least the stated one."""
        if self._variance_g2 is None:
            return np.full(3, stated_g)
        return np.maximum(np.sqrt(self._variance_g2), stated_g)
