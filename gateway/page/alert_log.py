"""The list of alerts of the last shift, from alert messages: those from before the page's start, and those that came since."""

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
        self._alerts: deque[LoggedAlert] = deque(maxlen=MOST_ALERTS)
        self._newest: Alert | None = None
        self._boot_since_ns: int | None = None
        """Time of the first message since the start of the gateway."""

    def add(self, message: Alert) -> None:
        """Take an alert message: begin, update, acknowledge and end alerts."""
        if self._newest is None or message.boot_id != self._newest.boot_id:
            self._begin_boot(message)
        elif _is_older(message, self._newest):
            return
        self._newest = message
        active = {alert.rule: alert for alert in message.active}
        for index, logged in enumerate(self._alerts):
            if logged.until_ns is None:
                same = active.pop(logged.rule) if _is_same(logged, active.get(logged.rule)) else None
                self._alerts[index] = _updated(logged, same, message)
            elif message.event == "acknowledged" and message.incident == logged.incident:
                self._alerts[index] = replace(
                    logged, acknowledged_by=message.acknowledged_by, acknowledged_ns=message.time_ns
                )
        for alert in active.values():
            if alert.level in LISTED:
                self._alerts.append(_begun(alert))
        while self._alerts and _end_ns(self._alerts[0], message.time_ns) < message.time_ns - SHIFT_NS:
            self._alerts.popleft()

    @property
    def since_ns(self) -> int | None:
        """Begin of the list; None before the first message. From then on, or for the length of a shift, it is complete.

        An empty list begins with the first message since the start of the gateway, because nothing was monitored before.
        """
        if self._newest is None or self._boot_since_ns is None:
            return None
        first_ns = min((self._boot_since_ns, *(alert.since_ns for alert in self._alerts)))
        return max(first_ns, self._newest.time_ns - SHIFT_NS)

    def _begin_boot(self, message: Alert) -> None:
        """Note a start of the gateway: it no longer knows the incidents from before."""
        self._boot_since_ns = message.time_ns
        for index, logged in enumerate(self._alerts):
            self._alerts[index] = replace(logged, incident=None)

    def alerts(self) -> list[LoggedAlert]:
        """Return the alerts, oldest first."""
        return list(self._alerts)


def _is_older(message: Alert, newest: Alert) -> bool:
    """Return whether a message of the same start was made before the newest one."""
    numbers = message.alert_number, newest.alert_number
    return numbers[0] is not None and numbers[1] is not None and numbers[0] < numbers[1]


def _is_same(logged: LoggedAlert, alert: ActiveAlert | None) -> bool:
    """Return whether an active alert continues an entry, and not a later incident of the same rule."""
    return alert is not None and (alert.incident == logged.incident or alert.incident is None)


def _begun(alert: ActiveAlert) -> LoggedAlert:
    return LoggedAlert(
        incident=alert.incident,
        rule=alert.rule,
        level=alert.level,
        since_ns=alert.since_ns,
        until_ns=None,
        largest_deg=alert.largest_deg,
        limit_deg=alert.limit_deg,
        acknowledged_by=alert.acknowledged_by,
        acknowledged_ns=alert.acknowledged_ns,
    )


def _updated(logged: LoggedAlert, alert: ActiveAlert | None, message: Alert) -> LoggedAlert:
    """Return the entry after a message. An alert that becomes unknown stays active, because its end is not known."""
    if alert is None:
        ended = message.largest_deg if message.incident == logged.incident else None
        return replace(logged, until_ns=message.time_ns, largest_deg=_larger(logged.largest_deg, ended))
    logged = replace(logged, largest_deg=_larger(logged.largest_deg, alert.largest_deg))
    if alert.incident is not None:
        logged = replace(logged, acknowledged_by=alert.acknowledged_by, acknowledged_ns=alert.acknowledged_ns)
    if RANK[alert.level] > RANK[logged.level]:
        return replace(logged, level=alert.level, limit_deg=alert.limit_deg)
    return logged


def _larger(first: float | None, second: float | None) -> float | None:
    return max((value for value in (first, second) if value is not None), default=None)


def _end_ns(logged: LoggedAlert, time_ns: int) -> int:
    return time_ns if logged.until_ns is None else logged.until_ns
