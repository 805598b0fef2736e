"""Windows of readings."""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.poses.pose import Array, RawReadings
from gateway.numerics.quantisation import smallest_steps

WINDOW_S = 0.25
LEAST_READINGS = 8
LARGEST_GAP_S = 1.0
"""Readings further apart belong to different poses: what happened between is not known."""


@dataclass(frozen=True, slots=True)
class Window:
    """Consecutive readings of about `WINDOW_S`."""

    start_s: float
    end_s: float
    count: int
    mean: Array
    """Shape (3,), raw."""
    square_sum: Array
    """Of the deviations from the mean, shape (3,)."""
    step: float
    """Smallest difference between two readings of an axis; 0 where all are alike."""
    temperature_c: float | None
    after_gap: bool
    """Readings are missing between the window before and this one."""

    @property
    def scatter(self) -> Array:
        """Standard deviation, shape (3,)."""
        return np.sqrt(self.square_sum / (self.count - 1))


class Windows:
    """Cuts readings into windows that do not depend on how they were delivered."""

    def __init__(self) -> None:
        self._time = np.empty(0)
        self._raw = np.empty((0, 3))
        self._temperature = np.empty(0)
        self._gap = False

    def feed(self, readings: RawReadings) -> list[Window]:
        """Windows that these readings complete."""
        temperature = np.nan if readings.temperature_c is None else readings.temperature_c
        self._time = np.concatenate([self._time, readings.time_s])
        self._raw = np.concatenate([self._raw, readings.raw])
        self._temperature = np.concatenate([self._temperature, np.full(len(readings.time_s), temperature)])
        found = []
        while (window := self._next()) is not None:
            found.append(window)
        return found

    def cut(self) -> None:
        """What follows is another stretch: readings that do not fill a window are left out."""
        self._drop(len(self._time))
        self._gap = True

    def _next(self) -> Window | None:
        while True:
            steps = np.diff(self._time)
            gaps = np.flatnonzero((steps > LARGEST_GAP_S) | (steps <= 0))
            usable = int(gaps[0]) + 1 if len(gaps) else len(self._time)
            full = int(np.searchsorted(self._time[:usable], self._time[0] + WINDOW_S)) + 1 if usable else 1
            count = max(full, LEAST_READINGS)
            if count <= usable:
                return self._take(count)
            if not len(gaps):
                return None
            self._drop(usable)
            self._gap = True

    def _take(self, count: int) -> Window:
        raw = self._raw[:count]
        mean = raw.mean(axis=0)
        known = self._temperature[:count][~np.isnan(self._temperature[:count])]
        window = Window(
            start_s=float(self._time[0]),
            end_s=float(self._time[count - 1]),
            count=count,
            mean=mean,
            square_sum=((raw - mean) ** 2).sum(axis=0),
            step=min((float(step) for step in smallest_steps(raw) if step > 0), default=0.0),
            temperature_c=float(known.mean()) if len(known) else None,
            after_gap=self._gap,
        )
        self._drop(count)
        self._gap = False
        return window

    def _drop(self, count: int) -> None:
        self._time, self._raw, self._temperature = self._time[count:], self._raw[count:], self._temperature[count:]
