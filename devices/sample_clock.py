"""Sample times of a part whose clock cannot be read, by regression of the sample count on gateway time.

The part samples at a constant rate that differs from the nominal one by per cents and drifts slowly. The host observes at
gateway time r that sample k is there: with a varying delay, never early. The line t(k) = a + p k therefore lies below every
observation (k, r) and touches those without delay. Of all lines below the observations, the one with the least sum of distances
is used. It contains the edge of the lower convex hull over the mean k (Moon et al. 1999). For a bounded delay its error
decreases as 1/n, that of least squares as 1/sqrt(n).

The part of the delay that is common to all observations cannot be found by a regression and remains as a constant error. A
device keeps it small by polling at the right moment (`SampleClock.due_ns`).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

WINDOW_NS = 60_000_000_000
"""Older observations are discarded, because the rate drifts with temperature. Basis: a choice; drift within a minute is small,
and the least delays of a minute are."""
N_BUCKETS = 32
"""The window consists of this many spans of time, each with its least delayed observation. Basis: a choice; two seconds each, in
which at least one read is prompt."""
NOMINAL_RATE_U = 0.05 / 3**0.5
"""Relative standard uncertainty of a nominal rate. Basis: within 5 %, uniformly distributed."""
RESTART_RATE_U = 1e-3
"""Least relative standard uncertainty of a measured rate that is kept over a restart. Basis: a choice; a rate changes by less
with the temperature after a restart."""
ANY_RATE_U = 0.5
"""Relative standard uncertainty of the rate when no line fits: the part may have been set to another rate. Basis: a choice; the
next rate of a part is twice or half."""
SLOPE_FACTOR = 6.0
"""Standard uncertainty of the slope x window x observations / mean distance. Basis: by simulation of uniform delays, rounded
up."""
MISFIT_DELAY_S = 0.02
"""A larger distance from the line, beyond two periods, means a wrong count or a host that was suspended. Basis: a choice; a
thread is late by less, but a wrong count at 50 Hz is as much."""
RADIO_MISFIT_DELAY_S = 1.0
"""Distance that means a restart where the count is certain. Basis: a radio may be late."""
MAX_MISFITS, MISFIT_NS = 8, 1_000_000_000
"""After this many misfits in a row, over at least this time, the line itself is wrong. Basis: a choice; single late reads are no
fault, and a wrong line is left within seconds."""

Observation = tuple[int, int]
"""The count of a sample, and the gateway time in ns at which it was observed."""


@dataclass(frozen=True, slots=True)
class _Line:
    """The line t(k) through (count, time_ns) with slope period_ns, whose relative standard uncertainty is period_u."""

    count: int
    time_ns: int
    period_ns: float
    period_u: float

    def time_of(self, count: int) -> int:
        return self.time_ns + round(self.period_ns * (count - self.count))

    def residual_of(self, observation: Observation) -> int:
        return observation[1] - self.time_of(observation[0])


def slope_below(points: list[tuple[float, float]]) -> float:
    """Return the slope of the line below all points with the least sum of distances; x ascends, at least two points."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1 and _is_above(hull[-1], hull[-2], (x, y)):
            hull.pop()
        hull.append((x, y))
    mean = sum(x for x, _ in points) / len(points)
    (x0, y0), (x1, y1) = next(edge for edge in pairwise(hull) if edge[1][0] >= mean)
    return (y1 - y0) / (x1 - x0)


def _is_above(middle: tuple[float, float], left: tuple[float, float], right: tuple[float, float]) -> bool:
    """Return whether the middle point lies on or above the line through its neighbours."""
    rise = (middle[1] - left[1]) * (right[0] - left[0])
    return rise >= (right[1] - left[1]) * (middle[0] - left[0])


class _Window:
    """The observations of the last minute, in a bounded number of buckets, and the line below them."""

    def __init__(self, prior_ns: float, prior_u: float, usual_delay_ns: float) -> None:
        self._prior_ns, self._prior_u = prior_ns, prior_u
        self._usual_delay_ns = usual_delay_ns
        self._observations: list[Observation] = []
        self._bucket_ns = 0
        self._bucket_start_ns = 0
        self.line: _Line | None = None

    def add(self, observation: Observation) -> _Line:
        """Add an observation and return the line."""
        line, read_ns = self.line, observation[1]
        if line is None or read_ns - self._bucket_start_ns >= self._bucket_ns:
            self._observations.append(observation)
            self._bucket_start_ns = read_ns
            if line is not None:
                self._limit_size(line, read_ns)
        else:
            height_ns = line.residual_of(observation)
            if height_ns < line.residual_of(self._observations[-1]):
                self._observations[-1] = observation
            if height_ns >= 0:
                return line
        self.line = self._fit()
        return self.line

    def _limit_size(self, line: _Line, read_ns: int) -> None:
        """Widen the buckets until they cover the window; after that drop the oldest ones."""
        kept = self._observations
        if len(kept) > N_BUCKETS and self._bucket_ns < WINDOW_NS // N_BUCKETS:
            self._bucket_ns = min(2 * (read_ns - kept[0][1]) // N_BUCKETS, WINDOW_NS // N_BUCKETS)
            self._observations = [min(kept[i : i + 2], key=line.residual_of) for i in range(0, len(kept), 2)]
        while len(self._observations) > N_BUCKETS or self._observations[0][1] < read_ns - WINDOW_NS:
            del self._observations[0]

    def _fit(self) -> _Line:
        """Fit the line below all observations; its slope is weighted with the prior period."""
        count, time_ns = self._observations[-1]
        points = [(float(k - count), float(r - time_ns)) for k, r in self._observations]
        period_ns, period_u = self._prior_ns, self._prior_u
        if len(points) > 1:
            slope_ns, slope_u = self._slope(points)
            weight = period_u**2 / (period_u**2 + slope_u**2)
            period_ns += weight * (slope_ns - period_ns)
            period_u = weight**0.5 * slope_u
        lowest_ns = min(y - period_ns * x for x, y in points)
        return _Line(count, time_ns + round(lowest_ns), period_ns, period_u)

    def _slope(self, points: list[tuple[float, float]]) -> tuple[float, float]:
        """Return the slope in ns and its relative standard uncertainty. One usual delay is added, for two points have no
        scatter."""
        slope_ns = max(slope_below(points), 0.0)
        heights_ns = [y - slope_ns * x for x, y in points]
        n = len(points)
        mean_height_ns = (sum(heights_ns) - n * min(heights_ns) + self._usual_delay_ns) / (n - 1)
        return slope_ns, SLOPE_FACTOR * mean_height_ns / (n * (points[-1][0] - points[0][0]) * self._prior_ns)


class SampleClock:
    """Counts the samples of one part and determines the time of each."""

    def __init__(
        self, nominal_rate_hz: float, usual_delay_s: float = 0.02, misfit_delay_s: float = MISFIT_DELAY_S
    ) -> None:
        """`usual_delay_s`: usual delay of an observation; one period for a FIFO whose level is read.

        `misfit_delay_s`: a later observation does not fit; larger than the default where the count is certain.
        """
        self._usual_delay_ns = usual_delay_s * 1e9
        self._misfit_delay_ns = misfit_delay_s * 1e9
        self._prior_ns, self._prior_u = 1e9 / nominal_rate_hz, NOMINAL_RATE_U
        self._count = 0
        self._last_ns: int | None = None
        self._last_count: int | None
        self.relearned = 0
        """How often the line was discarded because observations misfitted: samples were lost or added uncounted."""
        self._reset()

    def stamp(self, n: int, read_ns: int, lost: int = 0, behind: int = 0) -> NDArray[np.int64]:
        """Return the gateway times in ns of the next n samples, shape (n,), strictly increasing also from call to call.

        `read_ns` is the time at which these samples, and `behind` more that are still in the part, were observed. `lost`
        samples were taken just before and never arrived. n = 0 adds the observation and returns no times.
        """
        self._count += lost + n
        if self._count + behind == 0:  # no sample has been taken yet
            return np.empty(0, dtype=np.int64)
        newest = self._count - 1
        line = self._add_observation((newest + behind, read_ns))
        if n == 0:
            return np.empty(0, dtype=np.int64)
        times_ns = self._interpolate_times(line, n, newest)
        self._last_ns, self._last_count = int(times_ns[-1]), newest
        return times_ns

    def restart(self) -> None:
        """Discard the count after a reopening or an overrun. The rate remains as a prior."""
        line = self._window.line
        if line is not None:
            self._prior_ns, self._prior_u = line.period_ns, max(line.period_u, RESTART_RATE_U)
        self._reset()

    def due_ns(self, n: int) -> int | None:
        """Return the gateway time at which the n-th further sample will be there; None before the first observation."""
        line = self._window.line
        return None if line is None else line.time_of(self._count + n - 1)

    @property
    def measured_rate_hz(self) -> float | None:
        """Rate of the part in samples per second of gateway time; None while the nominal rate is as well known."""
        period_ns, period_u = self._period()
        return 1e9 / period_ns if period_u < NOMINAL_RATE_U / 2 else None

    @property
    def measured_rate_u_hz(self) -> float | None:
        """Standard uncertainty of `measured_rate_hz`."""
        rate_hz = self.measured_rate_hz
        return None if rate_hz is None else rate_hz * self._period()[1]

    def _period(self) -> tuple[float, float]:
        line = self._window.line
        return (self._prior_ns, self._prior_u) if line is None else (line.period_ns, line.period_u)

    def _reset(self) -> None:
        self._window = _Window(self._prior_ns, self._prior_u, self._usual_delay_ns)
        self._newest_count = -1
        self._observed_ns = 0
        self._misfits = 0
        self._misfit_start_ns = 0
        self._last_count = None

    def _add_observation(self, observation: Observation) -> _Line:
        """Add a new and plausible observation; start again after too many implausible ones."""
        count, read_ns = observation
        line = self._window.line
        if line is not None:
            if count <= self._newest_count:  # a later observation of the same sample adds nothing
                return line
            if not self._fits(line, observation):
                self._misfit_start_ns = self._misfit_start_ns if self._misfits else read_ns
                self._misfits += 1
                if self._misfits < MAX_MISFITS or read_ns - self._misfit_start_ns < MISFIT_NS:
                    return line
                self.relearned += 1
                self._prior_u = ANY_RATE_U
                self._reset()
        self._misfits = 0
        self._newest_count, self._observed_ns = count, read_ns
        return self._window.add(observation)

    def _fits(self, line: _Line, observation: Observation) -> bool:
        drift_ns = 4 * line.period_u * (observation[1] - self._observed_ns)
        return abs(line.residual_of(observation)) <= self._misfit_delay_ns + 2 * line.period_ns + drift_ns

    def _interpolate_times(self, line: _Line, n: int, newest: int) -> NDArray[np.int64]:
        """Return even times up to the newest sample. The change of the line since the last call is spread over the block."""
        end_ns = line.time_of(newest)
        start_ns, periods = end_ns - round(n * line.period_ns), n
        if self._last_ns is not None:
            if self._last_count is not None:
                start_ns, periods = self._last_ns, newest - self._last_count
            start_ns = max(start_ns, self._last_ns)
        step_ns = max((end_ns - start_ns) / periods, line.period_ns / 2)
        first_ns = start_ns + round(step_ns * (periods - n + 1))
        # Rounded from the first sample on, so that a recording can state a block's times as first + round(i * period).
        times_ns: NDArray[np.int64] = first_ns + np.rint(step_ns * np.arange(n)).astype(np.int64)
        return times_ns
