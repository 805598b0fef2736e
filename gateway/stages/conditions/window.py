"""The last seconds of specific force as bins, each with its mean, scatter, peak, and number of clipped and missing samples."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array

WINDOW_S = 2.0
MEMORY_S = 6.0
"""Length of the memory, for slow movements that the window is too short to show."""
BIN_S = 0.1
COMPLETE_SHARE = 0.95
"""A bin is complete from this share of its length on, because sample times jitter."""


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
        self._bins: deque[Bin] = deque(maxlen=round(MEMORY_S / BIN_S))
        self._open: list[Array] = []
        self._open_rates: list[Array] = []
        self._open_since_s: float | None = None
        self._last_s: float | None = None
        self._clipped = 0
        self._missing = 0

    def update(
        self, time_s: Array, force_g: Array, clipped: int, missing: int, rate_rad_s: Array | None = None
    ) -> None:
        """Add a block: times (n,), specific force (n, 3), numbers of clipped and missing samples, angular rates (n, 3)."""
        self._clipped += clipped
        self._missing += missing
        if self._last_s is not None and time_s[0] - self._last_s > WINDOW_S:
            self._bins.clear()  # after a gap longer than the window the earlier bins are not relevant
            self._open, self._open_rates, self._open_since_s = [], [], None
        self._last_s = float(time_s[-1])
        if self._open_since_s is None:
            self._open_since_s = float(time_s[0])
        self._open.append(force_g)
        if rate_rad_s is not None:
            self._open_rates.append(rate_rad_s[np.isfinite(rate_rad_s).all(axis=1)])
        count = sum(map(len, self._open))
        length_s = (
            (self._last_s - self._open_since_s) * count / max(count - 1, 1)
        )  # including the last sample's own period
        if length_s >= COMPLETE_SHARE * BIN_S:
            self._close_bin((self._open_since_s + self._last_s) / 2)

    @property
    def bins(self) -> list[Bin]:
        """The bins of the window, oldest first."""
        return list(self._bins)[-round(WINDOW_S / BIN_S) :]

    @property
    def memory(self) -> list[Bin]:
        """The bins of the longer memory, including the window."""
        return list(self._bins)

    def _close_bin(self, time_s: float) -> None:
        force_g = np.concatenate(self._open)
        mean_g = force_g.mean(axis=0)
        away_g = np.abs(force_g - mean_g)
        scatter_g = float(np.sqrt((away_g**2).mean()))
        peak_g = float(away_g.max())
        rates = np.concatenate(self._open_rates) if self._open_rates else np.empty((0, 3))
        rate_rad_s = rates.mean(axis=0) if len(rates) else None
        self._bins.append(
            Bin(time_s, mean_g, scatter_g, peak_g, len(force_g), self._clipped, self._missing, rate_rad_s)
        )
        self._open, self._open_rates, self._open_since_s, self._clipped, self._missing = [], [], None, 0, 0
