"""The list of alerts of the last shift, from the alert messages that the page has received."""

from collections import deque
from dataclasses import dataclass, replace

from gateway.messages import ActiveAlert, Alert, Level
from gateway.stages.alerts import RANK

MOST_ALERTS = 200
SHIFT_NS = 12 * 3600 * 10**9
"""Age at which an alert leaves the list. Basis: the longest shift."""
LISTED: tuple[Level, ...] = ("warn", "trip")


@dataclass(frozen=True, slots=True)
class LoggedAlert:
    """One alert from its beginning to its end."""

    rule: str
    level: Level
    """The highest level that it has reached."""
    since_ns: int
    until_ns: int | None
    """None while it is active."""
    largest_deg: float | None
    limit_deg: float | None
    """The limit of the highest level."""


class AlertLog:
    """Alerts in the order of their beginnings, bounded by number and age."""

    def __init__(self) -> None:
        self._alerts: deque[LoggedAlert] = deque(maxlen=MOST_ALERTS)
        self._since_ns: int | None = None

    def add(self, message: Alert) -> None:
        """Take an alert message: begin, update and end alerts."""
        if self._since_ns is None:
            self._since_ns = message.time_ns
        active = {alert.rule: alert for alert in message.active}
        for index, logged in enumerate(self._alerts):
            if logged.until_ns is None:
                self._alerts[index] = _updated(logged, active.pop(logged.rule, None), message.time_ns)
        for alert in active.values():
            if alert.level in LISTED:
                self._alerts.append(_begun(alert))
        while self._alerts and _end_ns(self._alerts[0], message.time_ns) < message.time_ns - SHIFT_NS:
            self._alerts.popleft()

    @property
    def since_ns(self) -> int | None:
        """Time of the first alert message; None before it. The list is complete from then on, for the length of a shift."""
        return self._since_ns

    def alerts(self) -> list[LoggedAlert]:
        """Return the alerts, oldest first."""
        return list(self._alerts)


def _begun(alert: ActiveAlert) -> LoggedAlert:
    return LoggedAlert(alert.rule, alert.level, alert.since_ns, None, alert.value_deg, alert.limit_deg)


def _updated(logged: LoggedAlert, alert: ActiveAlert | None, time_ns: int) -> LoggedAlert:
    """Return the entry after a message. An alert that becomes unknown stays active, because its end is not known."""
    if alert is None:
        return replace(logged, until_ns=time_ns)
    values = [value for value in (logged.largest_deg, alert.value_deg) if value is not None]
    largest_deg = max(values, default=None)
    if RANK[alert.level] > RANK[logged.level]:
        return replace(logged, level=alert.level, largest_deg=largest_deg, limit_deg=alert.limit_deg)
    return replace(logged, largest_deg=largest_deg)


def _end_ns(logged: LoggedAlert, time_ns: int) -> int:
    return time_ns if logged.until_ns is None else logged.until_ns
