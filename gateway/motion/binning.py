"""Means of the samples over short bins, and their noise: the filter takes a few readings a second instead of a thousand.

Vibration counts as noise, slow motion does not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

ROUNDING = 1e-6
"""Share of a bin by which a time on its edge may be rounded. Basis: sample times in steps of a microsecond or less."""


@dataclass(frozen=True, slots=True)
class ForceBin:
    """The mean of the samples in one bin."""

    time_s: float
    force_g: Array
    """Shape (3,)."""
    count: int
    is_clipped: bool
    rate_rad_s: Array | None = None
    """Mean angular rate, shape (3,); None where a sample has none."""
    scatter_g: Array | None = None
    """Standard deviation of the mean by how far its parts lie off a line, shape (3,); None where it has too few."""

    @property
    def is_usable(self) -> bool:
        """Whether the mean is that of what acted on the sensor."""
        return not self.is_clipped and bool(np.isfinite(self.force_g).all())


class Binning:
    """Collects blocks of samples into bins that end at whole multiples of their width."""

    def __init__(self, width_s: float) -> None:
        self._width_s = width_s
        self.clear()

    def clear(self) -> None:
        """Forget the bin that is not complete."""
        self._label: int | None = None
        self._time_sum_s, self._count, self._is_clipped = 0.0, 0, False
        self._force_sum_g = np.zeros(3)
        self._rate_sum_rad_s: Array | None = None

    def add(
        self,
        time_s: Array,
        force_g: Array,
        is_clipped: NDArray[np.bool_] | None = None,
        rate_rad_s: Array | None = None,
    ) -> list[ForceBin]:
        """Add a block, shapes (n,) and (n, 3); return the bins that it completes.

        `is_clipped`: which of its samples are, shape (n,); None: none. `rate_rad_s`: angular rates, shape (n, 3), NaN where a
        sample has none; None without a gyroscope.
        """
        complete: list[ForceBin] = []
        begin, n = 0, len(time_s)
        while begin < n:
            label = int(np.floor(time_s[begin] / self._width_s + ROUNDING))
            if label != self._label:
                complete += self._close()
                self._label = label
            end_s = (label + 1 - ROUNDING) * self._width_s
            end = n if time_s[-1] < end_s else max(begin + 1, int(np.searchsorted(time_s, end_s)))
            self._force_sum_g += force_g[begin:end].sum(axis=0)
            self._time_sum_s += float(time_s[begin:end].sum())
            self._count += end - begin
            if rate_rad_s is not None:
                self._rate_sum_rad_s = rate_rad_s[begin:end].sum(axis=0) + (
                    0.0 if self._rate_sum_rad_s is None else self._rate_sum_rad_s
                )
            if is_clipped is not None and is_clipped[begin:end].any():
                self._is_clipped = True
            begin = end
        return complete

    def finish(self) -> list[ForceBin]:
        """Return the bin that is not complete."""
        return self._close()

    def _close(self) -> list[ForceBin]:
        if self._count == 0:
            return []
        count = self._count
        total = self._rate_sum_rad_s
        rate_rad_s = None if total is None or not np.isfinite(total).all() else total / count
        closed = ForceBin(self._time_sum_s / count, self._force_sum_g / count, count, self._is_clipped, rate_rad_s)
        self._time_sum_s, self._count, self._is_clipped = 0.0, 0, False
        self._force_sum_g, self._rate_sum_rad_s = np.zeros(3), None
        return [closed]


class BinGroups:
    """Joins a fixed number of short bins to a longer one, leaving out those that cannot be used.

    The filter takes long bins, which average the fast motion of slings, strings and engines; the short ones tell how well.
    """

    def __init__(self, width_s: float, size: int) -> None:
        """`width_s`: of a short bin; `size`: short bins in a long one."""
        self._width_s, self._size = width_s, size
        self._label: int | None = None
        self._members: list[ForceBin] = []

    def add(self, one: ForceBin) -> list[ForceBin]:
        """Add a short bin; return the long bins that it completes."""
        label, place = divmod(int(np.floor(one.time_s / self._width_s)), self._size)
        complete = self._close() if label != self._label else []
        self._label = label
        self._members.append(one)
        return complete + self._close() if place == self._size - 1 else complete

    def finish(self) -> list[ForceBin]:
        """Return the long bin that is not complete."""
        return self._close()

    def _close(self) -> list[ForceBin]:
        members, self._members = self._members, []
        if not members:
            return []
        usable = [one for one in members if one.is_usable]
        kept = usable or members
        count = sum(one.count for one in kept)
        time_s = sum(one.count * one.time_s for one in kept) / count
        force_g = np.add.reduce([one.count * one.force_g for one in kept]) / count
        rates = [one.rate_rad_s for one in kept]
        rate_rad_s = None
        if all(rate is not None for rate in rates):
            rate_rad_s = (
                np.add.reduce([one.count * one.rate_rad_s for one in kept if one.rate_rad_s is not None]) / count
            )
        return [ForceBin(time_s, force_g, count, not usable, rate_rad_s, _scatter_g(usable))]


def _scatter_g(parts: list[ForceBin]) -> Array | None:
    spare = len(parts) - 2
    if spare < 1:
        return None
    time_s = np.array([one.time_s for one in parts])
    time_s -= time_s.mean()
    force_g = np.array([one.force_g for one in parts])
    force_g -= force_g.mean(axis=0)
    left_g2 = np.square(force_g).sum(axis=0) - np.square(time_s @ force_g) / (time_s @ time_s)
    scatter_g: Array = np.sqrt(np.maximum(left_g2, 0.0) / (spare * len(parts)))
    return scatter_g


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
