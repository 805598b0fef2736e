"""The list of alerts of the last shift, from alert messages: those from before the page's start, and those that came since."""

from dataclasses import dataclass

from gateway.alert_periods import AlertPeriod, AlertPeriods
from gateway.messages import Alert, Level

MAX_LISTED_ALERTS = 200
"""Alerts that the page lists. Basis: a choice; more than a shift has, and a bound of the memory."""
SHIFT_NS = 12 * 3600 * 10**9
"""Age at which an alert leaves the list. Basis: the longest shift."""


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
    limit_deg: float | None
    """The limit of the highest level."""
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
        logged = (self._logged(period) for period in self._periods.all)
        return [alert for alert in logged if alert is not None]

    def _is_forgotten(self, period: AlertPeriod[Alert], now_ns: int) -> bool:
        is_old = period.end_ns is not None and period.end_ns < now_ns - SHIFT_NS
        return is_old or len(self._periods.all) > MAX_LISTED_ALERTS

    def _logged(self, period: AlertPeriod[Alert]) -> LoggedAlert | None:
        """Return an alert as the page lists it; None for one that was not raised."""
        first, highest, present = period.raised, period.highest, period.present
        if first is None or first.active is None or highest is None or present is None or self._newest is None:
            return None
        by, at_ns = present.acknowledged_by, present.acknowledged_ns
        late = period.acknowledgement
        if late is not None and late.active is None:
            by, at_ns = late.statement.acknowledged_by, late.time_ns
        return LoggedAlert(
            # A gateway that started again does not know the incidents from before.
            incident=period.incident if first.statement.boot_id == self._newest.boot_id else None,
            rule=period.rule,
            level=highest.level,
            since_ns=first.active.since_ns,
            until_ns=period.end_ns,
            largest_deg=period.largest_deg,
            limit_deg=highest.limit_deg,
            acknowledged_by=by,
            acknowledged_ns=at_ns,
        )


def _is_older(message: Alert, newest: Alert) -> bool:
    """Return whether a message of the same start was made before the newest one."""
    numbers = message.alert_number, newest.alert_number
    return numbers[0] is not None and numbers[1] is not None and numbers[0] < numbers[1]
