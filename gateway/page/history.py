"""The last minutes of the swing, kept so that a fresh browser has a trend at once."""

from collections import deque
from dataclasses import dataclass
from itertools import islice

from gateway.messages import Swing

SPAN_S = 600.0
MOST_POINTS = 2000
"""Bounds the memory whatever the rate; at the usual one or two a second the span is reached first."""


@dataclass(frozen=True, slots=True)
class Point:
    """One swing estimate; all null where the data stopped."""

    index: int
    at_s: float
    phi_max_deg: float | None
    low_deg: float | None
    high_deg: float | None
    sound: bool

    @property
    def is_gap(self) -> bool:
        """Nothing to draw."""
        return self.phi_max_deg is None and self.high_deg is None


class History:
    """Bounded by time and number, oldest first."""

    def __init__(self) -> None:
        self._points: deque[Point] = deque(maxlen=MOST_POINTS)
        self._next = 0

    @property
    def next_index(self) -> int:
        """Index that the next point will have."""
        return self._next

    def add(self, swing: Swing, *, sound: bool, at_s: float) -> None:
        """Append an estimate; where nothing swings there is an upper bound only."""
        low, high = swing.coverage95_deg or (None, None)
        phi_max_deg = swing.phi_max_deg if swing.swinging else None
        self._append(Point(self._next, at_s, phi_max_deg, low, high, sound))

    def add_gap(self, *, at_s: float) -> None:
        """Mark that the data stopped; once is enough."""
        if self._points and not self._points[-1].is_gap:
            self._append(Point(self._next, at_s, None, None, None, sound=False))

    def rows(self, *, since: int, now_s: float) -> list[list[float | bool | None]]:
        """Points from an index on, for the browser: index, age in s, phi_max, low, high in degrees, sound."""
        first = self._next - len(self._points)
        return [
            [
                p.index,
                round(now_s - p.at_s, 2),
                *map(_short, (p.phi_max_deg, p.low_deg, p.high_deg)),
                p.sound,
            ]
            for p in islice(self._points, max(since - first, 0), None)
        ]

    def _append(self, point: Point) -> None:
        self._points.append(point)
        self._next += 1
        while self._points[0].at_s < point.at_s - SPAN_S:
            self._points.popleft()


def _short(value_deg: float | None) -> float | None:
    """A pixel is worth more than a hundredth of a degree."""
    return None if value_deg is None else round(value_deg, 2)
