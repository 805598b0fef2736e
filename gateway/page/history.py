"""What a new browser gets of the past: the swing of the last minutes as a trend, and the alerts of the last shift."""

import secrets
from collections import deque
from dataclasses import dataclass
from itertools import islice

from gateway.alert_periods import MAX_ENDED_INCIDENTS, SHIFT_NS, AlertPeriod, AlertPeriods
from gateway.messages import Alert, Level, Motion
from gateway.numerics.stats import NORMAL_975

SPAN_S = 600.0
"""Time that the trend shows. Basis: a choice; some lifts, at the pixels of a tablet."""
SPACING_S = 0.5
"""Shortest time between two points. Basis: the trend of `SPAN_S` is drawn on a few hundred pixels."""
MAX_HISTORY_POINTS = 2000
"""Limits the memory at any rate; at two points per second `SPAN_S` is reached first. Basis: a choice; more than `SPAN_S` has at
two points per second."""
MAX_LISTED_ALERTS = 200
"""Alerts that the page lists. Basis: a choice; more than a shift has, and a bound of the memory."""


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
        self.id = secrets.token_hex(4)
        """Tells whose points a browser has: the indices begin anew with each process."""

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


@dataclass(frozen=True, slots=True)
class LoggedAlert:
    """One alert from its beginning to its end."""

    incident: str | None
    """Id by which it is acknowledged; None: it cannot be."""
    rule: str
    level: Level
    """The highest level that it has reached."""
    since_ns: int
    until_ns: int | None
    """None while it is active."""
    largest_deg: float | None
    """Largest angle since it began, best estimate: a peak that was only expected does not count. None: no angle was known."""
    is_cut: bool
    """It was not followed to its end, so that a larger angle may have come: the gateway ended, or its end was not stated."""
    limit_deg: float | None
    """The limit of the highest level."""
    is_corrected: bool
    """That limit was not reached."""
    acknowledged_by: str | None
    """Who acknowledged it at its present level; None: nobody."""
    acknowledged_ns: int | None


class AlertLog:
    """Alerts in the order of their beginnings, bounded by number and age."""

    def __init__(self) -> None:
        self._periods: AlertPeriods[Alert] = AlertPeriods()
        self._newest: Alert | None = None
        self._boot_since_ns: int | None = None
        """Time of the first message since the start of the gateway."""

    def add(self, message: Alert) -> None:
        """Take an alert message: begin, update, acknowledge and end alerts."""
        if self._newest is None or message.boot_id != self._newest.boot_id:
            self._boot_since_ns = message.time_ns
            self._periods.end_boot(message.time_ns)
        elif _is_older(message, self._newest):
            return
        self._newest = message
        self._periods.add(message.time_ns, message)
        while self._periods.all and self._is_forgotten(self._periods.all[0], message.time_ns):
            self._periods.forget_first()

    @property
    def since_ns(self) -> int | None:
        """Begin of the list; None before the first message. From then on, or for the length of a shift, it is complete.

        An empty list begins with the first message since the start of the gateway, because nothing was monitored before.
        """
        if self._newest is None or self._boot_since_ns is None:
            return None
        first_ns = min((self._boot_since_ns, *(alert.since_ns for alert in self.alerts())))
        return max(first_ns, self._newest.time_ns - SHIFT_NS)

    def alerts(self) -> list[LoggedAlert]:
        """Return the alerts, oldest first."""
        known = self._known_incidents()
        logged = (self._logged(period, known) for period in self._periods.all)
        return [alert for alert in logged if alert is not None]

    def _known_incidents(self) -> set[str | None]:
        """Return the incidents that the gateway knows, the last ones; it acknowledges no other."""
        ended = sorted(
            (one.end_ns, one.incident) for one in self._periods.all if one.end_ns is not None and one.incident
        )
        forgotten = {incident for _, incident in ended[:-MAX_ENDED_INCIDENTS]}
        return {one.incident for one in self._periods.all} - forgotten

    def _is_forgotten(self, period: AlertPeriod[Alert], now_ns: int) -> bool:
        is_old = period.end_ns is not None and period.end_ns < now_ns - SHIFT_NS
        return is_old or len(self._periods.all) > MAX_LISTED_ALERTS

    def _logged(self, period: AlertPeriod[Alert], known: set[str | None]) -> LoggedAlert | None:
        """Return an alert as the page lists it; None for one that was not raised."""
        first, highest = period.raised, period.highest
        if first is None or first.active is None or highest is None or self._newest is None:
            return None
        by, at_ns = period.acknowledged
        return LoggedAlert(
            incident=period.incident if period.incident in known else None,
            rule=period.rule,
            level=highest.level,
            since_ns=first.active.since_ns,
            until_ns=period.end_ns,
            largest_deg=period.largest_deg,
            is_cut=period.ended in ("gateway ended", "not recorded"),
            limit_deg=highest.limit_deg,
            is_corrected=period.is_corrected,
            acknowledged_by=by,
            acknowledged_ns=at_ns,
        )


def _is_older(message: Alert, newest: Alert) -> bool:
    """Return whether a message of the same start was made before the newest one."""
    numbers = message.alert_number, newest.alert_number
    return numbers[0] is not None and numbers[1] is not None and numbers[0] < numbers[1]
