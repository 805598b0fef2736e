"""The swing of the last minutes, from the motion of the rope, so that a new browser has a trend at once."""

from collections import deque
from dataclasses import dataclass
from itertools import islice

from gateway.messages import Motion
from gateway.numerics.stats import NORMAL_975

SPAN_S = 600.0
"""Time that the trend shows. Basis: a choice; some lifts, at the pixels of a tablet."""
SPACING_S = 0.5
"""Shortest time between two points. Basis: the trend of `SPAN_S` is drawn on a few hundred pixels."""
MAX_HISTORY_POINTS = 2000
"""Limits the memory at any rate; at two points per second `SPAN_S` is reached first. Basis: a choice; more than `SPAN_S` has at
two points per second."""


@dataclass(frozen=True, slots=True)
class TrendPoint:
    """The largest angle of the last period; all None where data are missing or the angle is not known."""

    index: int
    at_s: float
    phi_max_deg: float | None
    low_deg: float | None
    high_deg: float | None
    sound: bool

    @property
    def is_gap(self) -> bool:
        """Whether there is nothing to draw."""
        return self.phi_max_deg is None and self.high_deg is None


class History:
    """The points of the trend, bounded by time and number, oldest first."""

    def __init__(self) -> None:
        self._points: deque[TrendPoint] = deque(maxlen=MAX_HISTORY_POINTS)
        self._next = 0

    @property
    def next_index(self) -> int:
        """Index of the next point."""
        return self._next

    def add(self, motion: Motion, *, sound: bool, at_s: float) -> None:
        """Append the largest angle of the last period, unless the last point is too near; not known, it is a gap."""
        if motion.phi_max_deg is None or motion.phi_max_u_deg is None:
            self.add_gap(at_s=at_s)
            return
        if self._points and not self._points[-1].is_gap and at_s - self._points[-1].at_s < SPACING_S:
            return
        low_deg = max(0.0, motion.phi_max_deg - NORMAL_975 * motion.phi_max_u_deg)
        high_deg = motion.phi_max_deg + NORMAL_975 * motion.phi_max_u_deg
        self._append(TrendPoint(self._next, at_s, motion.phi_max_deg, low_deg, high_deg, sound))

    def add_gap(self, *, at_s: float) -> None:
        """Append one gap where data are missing."""
        if self._points and not self._points[-1].is_gap:
            self._append(TrendPoint(self._next, at_s, None, None, None, sound=False))

    def rows(self, *, since: int, now_s: float) -> list[list[float | bool | None]]:
        """Return the points from an index on, for the browser: index, age in s, phi_max, low, high in degrees, sound."""
        first = self._next - len(self._points)
        return [
            [
                p.index,
                round(now_s - p.at_s, 2),
                *map(_round, (p.phi_max_deg, p.low_deg, p.high_deg)),
                p.sound,
            ]
            for p in islice(self._points, max(since - first, 0), None)
        ]

    def _append(self, point: TrendPoint) -> None:
        self._points.append(point)
        self._next += 1
        while self._points[0].at_s < point.at_s - SPAN_S:
            self._points.popleft()


def _round(value_deg: float | None) -> float | None:
    """Round to a hundredth of a degree, which is less than a pixel."""
    return None if value_deg is None else round(value_deg, 2)
