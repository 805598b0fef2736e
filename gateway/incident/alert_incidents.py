"""The incidents in a recording, from the messages of its alerts."""

from collections.abc import Iterable
from dataclasses import dataclass

from gateway.alert_periods import AlertPeriods, AlertStep
from gateway.messages import LEVEL_RANK, Alert, Level

STANDING = "standing"
"""The event of an alert that had been raised before the recordings begin."""


@dataclass(frozen=True, slots=True)
class IncidentChange:
    """One change of an incident."""

    time_ns: int
    """Gateway time."""
    event: str
    level: Level
    text: str
    value_deg: float | None
    """Upper end of the 95 % interval of the angle, or of a coming peak."""
    is_bound: bool | None
    """The limit is reached by the upper end alone: the best estimate of the angle is below it."""
    limit_deg: float | None
    clear_deg: float | None
    acknowledged_by: str | None = None
    """Who acknowledged the incident by this change."""
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class AlertIncident:
    """The time of one rule from raised to cleared."""

    number: int
    """Within the recordings, from 1 in order of time."""
    id: str
    rule: str
    changes: tuple[IncidentChange, ...]
    last_ns: int
    """Gateway time of the last message in which it stood, or of its end."""

    @property
    def raised_ns(self) -> int:
        """Gateway time of the first change; the raise itself may be before the recordings."""
        return self.changes[0].time_ns

    @property
    def cleared_ns(self) -> int | None:
        """Gateway time of its end; None where the recordings have none: they end, or the gateway was stopped."""
        return next((change.time_ns for change in reversed(self.changes) if change.event == "cleared"), None)

    @property
    def acknowledgement(self) -> IncidentChange | None:
        """The last acknowledgement, which may come after the end; None where the recordings have none."""
        return next((change for change in reversed(self.changes) if change.acknowledged_by is not None), None)

    @property
    def highest(self) -> IncidentChange:
        """The first change to the highest level."""
        return max(self.changes, key=lambda change: (LEVEL_RANK[change.level], -change.time_ns))

    @property
    def level(self) -> Level:
        """The highest level."""
        return self.highest.level


def find_incidents(alerts: Iterable[tuple[int, Alert]]) -> list[AlertIncident]:
    """Return the incidents of alert messages with their gateway times, in order of time.

    Recordings made before incidents had an id are joined by rule, from raised to cleared.
    """
    periods: AlertPeriods[Alert] = AlertPeriods()
    for time_ns, alert in alerts:
        periods.add(time_ns, alert)
    ordered = sorted(periods.all, key=lambda period: period.steps[0].time_ns)
    return [
        AlertIncident(
            number,
            period.incident or f"{period.rule} {number}",
            period.rule,
            tuple(map(_change, period.steps)),
            period.last_ns,
        )
        for number, period in enumerate(ordered, 1)
    ]


def _change(step: AlertStep[Alert]) -> IncidentChange:
    alert, active = step.statement, step.active
    is_own = active is None or active.rule == alert.rule
    return IncidentChange(
        time_ns=step.time_ns,
        event=alert.event if is_own else STANDING,
        level="normal" if active is None else active.level,
        text=(alert.change or alert.text) if is_own or active is None else active.text,
        value_deg=None if active is None else active.value_deg,
        is_bound=None if active is None else active.is_bound,
        limit_deg=alert.limit_deg if active is None else active.limit_deg,
        clear_deg=alert.clear_deg if active is None else active.clear_deg,
        acknowledged_by=alert.acknowledged_by if is_own else None,
        reason=alert.reason if is_own else None,
    )
