"""Windows of consecutive readings, cut by the times of the readings and not by the blocks in which they arrive."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from gateway.calibration.pose import RawReadings, correlation_factor
from gateway.numerics.array import Array
from gateway.numerics.stats import smallest_steps

POSE_WINDOW_S = 0.25
"""Duration of a window, s. Basis: several windows fit into the shortest rest, and each has readings enough for a scatter."""
MIN_WINDOW_READINGS = 8
"""Least number of readings in a window; at low sample rates a window lasts longer for it. Basis: a choice; a scatter is then good
to a quarter."""
MAX_GAP_S = 1.0
"""Readings further apart, s, belong to different poses: the motion in between is not known. Basis: a choice; a hand takes a
second to turn a housing, and lost readings leave shorter gaps."""
MAX_KEPT_WINDOWS = 400
"""Number of windows whose scatter is kept. Basis: a choice; 100 s, in which any session has a rest, and a bound of the memory."""
QUIET_QUANTILE = 0.2
"""Quantile of the windows' scatter that is taken for the sensor's noise. Basis: one window in five is at rest in every
session."""
STILL_RATIO = 3.0
"""Largest scatter of a still window over the sensor's noise. Basis: a choice; the scatter of eight readings of a sensor at rest
stays below twice the noise."""
STILL_LIMIT_G = 0.025
"""Largest scatter of a still window for any sensor, g. Basis: a hand or a running machine moves it by more."""


@dataclass(frozen=True, slots=True)
class Window:
    """Consecutive readings of about `POSE_WINDOW_S`."""

    start_s: float
    end_s: float
    count: int
    mean: Array
    """Mean reading, raw, shape (3,)."""
    square_sum: Array
    """Sum of the squared deviations from the mean, shape (3,)."""
    step: float
    """Smallest difference between two readings of an axis; 0 if all readings of every axis are equal."""
    temperature_c: float | None
    after_gap: bool
    """Whether readings are missing between the previous window and this one."""

    @property
    def sigma(self) -> Array:
        """Standard deviation of the readings, shape (3,)."""
        return np.sqrt(self.square_sum / (self.count - 1))


@dataclass(slots=True)
class Rest:
    """Still windows of one attitude; what follows from them needs one at least."""

    windows: list[Window] = field(default_factory=list)

    @property
    def duration_s(self) -> float:
        """Time from the begin of the first window to the end of the last one, s; 0 without a window."""
        return self.windows[-1].end_s - self.windows[0].start_s if self.windows else 0.0

    @property
    def count(self) -> int:
        """Number of readings."""
        return sum(window.count for window in self.windows)

    def means(self) -> Array:
        """Return the mean of each window, raw, shape (k, 3)."""
        return np.array([window.mean for window in self.windows])

    def counts(self) -> Array:
        """Return the number of readings of each window, shape (k,)."""
        return np.array([window.count for window in self.windows], dtype=np.float64)

    def mean(self) -> Array:
        """Return the mean of all readings, raw, shape (3,)."""
        return np.asarray(self.counts() @ self.means() / self.count)

    def sigma(self) -> Array:
        """Return the standard deviation of a reading within the windows, shape (3,)."""
        return np.asarray(np.sqrt(sum(window.square_sum for window in self.windows) / (self.count - len(self.windows))))

    def type_a(self) -> Array:
        """Return the standard uncertainty of the mean, correlation included, shape (3,)."""
        sigma = self.sigma()
        return np.asarray(sigma / np.sqrt(self.count) * correlation_factor(self.means(), self.counts(), sigma))


class WindowSplitter:
    """Splits a stream of readings into windows."""

    def __init__(self) -> None:
        self._time = np.empty(0)
        self._raw = np.empty((0, 3))
        self._temperature = np.empty(0)
        self._gap = False

    def feed(self, readings: RawReadings) -> list[Window]:
        """Return the windows that these readings complete."""
        temperature = np.nan if readings.temperature_c is None else readings.temperature_c
        self._time = np.concatenate([self._time, readings.time_s])
        self._raw = np.concatenate([self._raw, readings.raw])
        self._temperature = np.concatenate([self._temperature, np.full(len(readings.time_s), temperature)])
        windows = []
        while (window := self._next_window()) is not None:
            windows.append(window)
        return windows

    def start_new_segment(self) -> None:
        """Discard the readings of an incomplete window; the next window counts as one after a gap."""
        self._discard(len(self._time))
        self._gap = True

    def _next_window(self) -> Window | None:
        while True:
            intervals = np.diff(self._time)
            gaps = np.flatnonzero((intervals > MAX_GAP_S) | (intervals <= 0))
            usable = int(gaps[0]) + 1 if len(gaps) else len(self._time)
            full = int(np.searchsorted(self._time[:usable], self._time[0] + POSE_WINDOW_S)) + 1 if usable else 1
            count = max(full, MIN_WINDOW_READINGS)
            if count <= usable:
                return self._take_window(count)
            if not len(gaps):
                return None
            self._discard(usable)
            self._gap = True

    def _take_window(self, count: int) -> Window:
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
        self._discard(count)
        self._gap = False
        return window

    def _discard(self, count: int) -> None:
        self._time, self._raw, self._temperature = self._time[count:], self._raw[count:], self._temperature[count:]


class StillnessGate:
    """Decides whether a window is still, by the noise that the sensor has shown so far."""

    def __init__(self, units_per_g: float) -> None:
        self.noise_g = 0.0
        """Standard deviation of one reading, g, from the quiet windows so far; 0 before the first window."""
        self._units_per_g = units_per_g
        self._window_sigmas_g: deque[float] = deque(maxlen=MAX_KEPT_WINDOWS)

    def is_still(self, window: Window) -> bool:
        """Include the window in the estimate of the noise, and return whether it is still."""
        sigma_g = float(np.max(window.sigma)) / self._units_per_g
        step_g = window.step / self._units_per_g
        self._window_sigmas_g.append(sigma_g)
        self.noise_g = _quiet(np.array(self._window_sigmas_g))
        return sigma_g <= min(max(STILL_RATIO * self.noise_g, step_g), STILL_LIMIT_G)


def _quiet(sigmas: Array) -> float:
    """Return the quantile `QUIET_QUANTILE`, interpolated; `numpy.quantile` takes five times as long for so few values."""
    rank = QUIET_QUANTILE * (len(sigmas) - 1)
    below = int(rank)
    above = min(below + 1, len(sigmas) - 1)
    ordered = np.partition(sigmas, (below, above))
    return float(ordered[below] + (rank - below) * (ordered[above] - ordered[below]))
