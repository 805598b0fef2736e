"""Sample times of a part whose clock cannot be read, from sample counts and the gateway times at which they were seen.

The part makes samples evenly, at a rate of its own that is off by per cents and drifts slowly. The host learns at gateway
time r that sample k is there: late, by a delay that varies, never early. The line t(k) = a + p k therefore lies below every
(k, r) and touches those that were seen at once. Of all lines below, the one with the least sum of heights above it is taken:
it holds the edge of the lower convex hull over the mean k (Moon, Skelly and Towsley, INFOCOM 1999, "Estimation and removal
of clock skew from network delay measurements"). For a bounded delay its error falls as 1/n, that of least squares as 1/sqrt(n).

What no regression can find is the part of the delay that every reading has: it stays as a constant. Times are late by it,
so a device keeps it small by looking at the right moment (`SampleClock.due_ns`).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

WINDOW_NS = 60_000_000_000
"""Older sightings are forgotten: the rate drifts with temperature."""
BUCKETS = 32
"""The window is kept as so many spans of time, each with its least delayed sighting."""
NOMINAL_RATE_U = 0.05 / 3**0.5
"""Relative standard uncertainty of a data sheet's rate: within 5 %, uniform."""
KEPT_RATE_U = 1e-3
"""The same, at least, of a measured rate that is taken over by a restart."""
ANY_RATE_U = 0.5
"""The same where nothing fits: the part may have been set to another rate."""
SPREAD = 6.0
"""Standard uncertainty of the slope x window x sightings / mean height; from simulated uniform delays, rounded up."""
MISFIT_DELAY_NS = 20_000_000
"""A sighting further from the line than this and two periods tells of a wrong count or a host that stood still."""
MISFITS, MISFIT_NS = 8, 1_000_000_000
"""So many misfits in a row, over at least this time, and the line itself is wrong."""

Sighting = tuple[int, int]
"""A sample's count and the gateway time in ns at which it was seen to be there."""


@dataclass(frozen=True, slots=True)
class _Line:
    """t(k) through (count, time_ns) with slope period_ns, whose relative standard uncertainty is period_u."""

    count: int
    time_ns: int
    period_ns: float
    period_u: float

    def time_of(self, count: int) -> int:
        return self.time_ns + round(self.period_ns * (count - self.count))

    def residual_of(self, sighting: Sighting) -> int:
        return sighting[1] - self.time_of(sighting[0])


def slope_below(points: list[tuple[float, float]]) -> float:
    """Slope of the line below all points (x ascending, at least two) that has the least sum of heights above it."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1 and _is_above(hull[-1], hull[-2], (x, y)):
            hull.pop()
        hull.append((x, y))
    mean = sum(x for x, _ in points) / len(points)
    (x0, y0), (x1, y1) = next(edge for edge in pairwise(hull) if edge[1][0] >= mean)
    return (y1 - y0) / (x1 - x0)


def _is_above(middle: tuple[float, float], left: tuple[float, float], right: tuple[float, float]) -> bool:
    """The middle point lies on or above the line through its neighbours."""
    rise = (middle[1] - left[1]) * (right[0] - left[0])
    return rise >= (right[1] - left[1]) * (middle[0] - left[0])


class _Window:
    """The sightings of the last minute, in a bounded number of buckets, and the line below them."""

    def __init__(self, believed_ns: float, believed_u: float, usual_delay_ns: float) -> None:
        self._believed_ns, self._believed_u = believed_ns, believed_u
        self._usual_delay_ns = usual_delay_ns
        self._sightings: list[Sighting] = []
        self._bucket_ns = 0
        self._bucket_start_ns = 0
        self.line: _Line | None = None

    def add(self, sighting: Sighting) -> _Line:
        """Take in one more and return the line."""
        line, read_ns = self.line, sighting[1]
        if line is None or read_ns - self._bucket_start_ns >= self._bucket_ns:
            self._sightings.append(sighting)
            self._bucket_start_ns = read_ns
            if line is not None:
                self._bound(line, read_ns)
        else:
            height_ns = line.residual_of(sighting)
            if height_ns < line.residual_of(self._sightings[-1]):
                self._sightings[-1] = sighting
            if height_ns >= 0:
                return line
        self.line = self._fit()
        return self.line

    def _bound(self, line: _Line, read_ns: int) -> None:
        """Widen the buckets until they span the window, from then on drop the oldest."""
        kept = self._sightings
        if len(kept) > BUCKETS and self._bucket_ns < WINDOW_NS // BUCKETS:
            self._bucket_ns = min(2 * (read_ns - kept[0][1]) // BUCKETS, WINDOW_NS // BUCKETS)
            self._sightings = [min(kept[i : i + 2], key=line.residual_of) for i in range(0, len(kept), 2)]
        while len(self._sightings) > BUCKETS or self._sightings[0][1] < read_ns - WINDOW_NS:
            del self._sightings[0]

    def _fit(self) -> _Line:
        """The line below all sightings, its slope weighed with the believed one."""
        count, time_ns = self._sightings[-1]
        points = [(float(k - count), float(r - time_ns)) for k, r in self._sightings]
        period_ns, period_u = self._believed_ns, self._believed_u
        if len(points) > 1:
            slope_ns, slope_u = self._slope(points)
            weight = period_u**2 / (period_u**2 + slope_u**2)
            period_ns += weight * (slope_ns - period_ns)
            period_u = weight**0.5 * slope_u
        lowest_ns = min(y - period_ns * x for x, y in points)
        return _Line(count, time_ns + round(lowest_ns), period_ns, period_u)

    def _slope(self, points: list[tuple[float, float]]) -> tuple[float, float]:
        """Slope in ns and its relative standard uncertainty. One usual delay is counted in: two points have no spread."""
        slope_ns = max(slope_below(points), 0.0)
        heights_ns = [y - slope_ns * x for x, y in points]
        n = len(points)
        mean_height_ns = (sum(heights_ns) - n * min(heights_ns) + self._usual_delay_ns) / (n - 1)
        return slope_ns, SPREAD * mean_height_ns / (n * (points[-1][0] - points[0][0]) * self._believed_ns)


class SampleClock:
    """Counts the samples of one part and tells when each was taken."""

    def __init__(self, nominal_rate_hz: float, usual_delay_s: float = 0.02) -> None:
        """`usual_delay_s`: how late a sample is commonly seen; one period for a FIFO whose level is read."""
        self._usual_delay_ns = usual_delay_s * 1e9
        self._believed_ns, self._believed_u = 1e9 / nominal_rate_hz, NOMINAL_RATE_U
        self._count = 0
        self._last_ns: int | None = None
        self._last_count: int | None
        self.relearned = 0
        """How often the line was given up because sightings kept missing it: samples came or went uncounted."""
        self._forget()

    def stamp(self, n: int, read_ns: int, lost: int = 0, behind: int = 0) -> NDArray[np.int64]:
        """Gateway times in ns of the next n samples, shape (n,), strictly increasing also from call to call.

        `read_ns` is when these n, and `behind` more that the part still holds, were seen to be there. `lost` samples were
        made just before and never came. n = 0 records what was seen and hands out nothing.
        """
        self._count += lost + n
        if self._count + behind == 0:  # not even the first sample has been made
            return np.empty(0, dtype=np.int64)
        newest = self._count - 1
        line = self._add_observation((newest + behind, read_ns))
        if n == 0:
            return np.empty(0, dtype=np.int64)
        times_ns = self._interpolate_times(line, n, newest)
        self._last_ns, self._last_count = int(times_ns[-1]), newest
        return times_ns

    def restart(self) -> None:
        """The count is not known any more (reopened, overrun): learn the phase anew. The rate stays as a belief."""
        line = self._window.line
        if line is not None:
            self._believed_ns, self._believed_u = line.period_ns, max(line.period_u, KEPT_RATE_U)
        self._forget()

    def due_ns(self, n: int) -> int | None:
        """Gateway time at which the n-th sample after those handed out will be there; None before the first was seen."""
        line = self._window.line
        return None if line is None else line.time_of(self._count + n - 1)

    @property
    def measured_rate_hz(self) -> float | None:
        """The part's own rate in samples per second of gateway time; None while the data sheet knows it as well."""
        period_ns, period_u = self._period()
        return 1e9 / period_ns if period_u < NOMINAL_RATE_U / 2 else None

    @property
    def measured_rate_u_hz(self) -> float | None:
        """Standard uncertainty of `measured_rate_hz`."""
        rate_hz = self.measured_rate_hz
        return None if rate_hz is None else rate_hz * self._period()[1]

    def _period(self) -> tuple[float, float]:
        line = self._window.line
        return (self._believed_ns, self._believed_u) if line is None else (line.period_ns, line.period_u)

    def _forget(self) -> None:
        self._window = _Window(self._believed_ns, self._believed_u, self._usual_delay_ns)
        self._newest_seen = -1
        self._seen_ns = 0
        self._misfits = 0
        self._misfit_start_ns = 0
        self._last_count = None

    def _add_observation(self, sighting: Sighting) -> _Line:
        """Take in a sighting that is new and plausible; after too many that are not, begin anew."""
        count, read_ns = sighting
        line = self._window.line
        if line is not None:
            if count <= self._newest_seen:  # a later look at the same sample says nothing new
                return line
            if not self._fits(line, sighting):
                self._misfit_start_ns = self._misfit_start_ns if self._misfits else read_ns
                self._misfits += 1
                if self._misfits < MISFITS or read_ns - self._misfit_start_ns < MISFIT_NS:
                    return line
                self.relearned += 1
                self._believed_u = ANY_RATE_U
                self._forget()
        self._misfits = 0
        self._newest_seen, self._seen_ns = count, read_ns
        return self._window.add(sighting)

    def _fits(self, line: _Line, sighting: Sighting) -> bool:
        drift_ns = 4 * line.period_u * (sighting[1] - self._seen_ns)
        return abs(line.residual_of(sighting)) <= MISFIT_DELAY_NS + 2 * line.period_ns + drift_ns

    def _interpolate_times(self, line: _Line, n: int, newest: int) -> NDArray[np.int64]:
        """Even times up to the newest sample's: what the line has moved since the last call is taken up over the block."""
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
