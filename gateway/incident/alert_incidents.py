"""The incidents in a recording, from the messages of its alerts."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from gateway.messages import ActiveAlert, Alert, Level
from gateway.stages.alerts import RANK

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
        return max(self.changes, key=lambda change: (RANK[change.level], -change.time_ns))

    @property
    def level(self) -> Level:
        """The highest level."""
        return self.highest.level


@dataclass(slots=True)
class _IncidentDraft:
    """An incident whose messages are still being read."""

    rule: str
    changes: list[IncidentChange]
    last_ns: int


@dataclass(slots=True)
class _IncidentReader:
    """Joins the messages of alerts to incidents."""

    drafts: dict[str, _IncidentDraft] = field(default_factory=dict)
    open_names: dict[str, str] = field(default_factory=dict)
    """Names of incidents without an id, by rule: of recordings made before incidents had one."""

    def add(self, time_ns: int, alert: Alert) -> None:
        """Take a message."""
        for active in alert.active:
            name = active.incident or self.open_names.get(active.rule)
            if name in self.drafts:
                self.drafts[name].last_ns = time_ns
            elif name is not None and active.rule != alert.rule:  # raised before the recordings
                self.drafts[name] = _IncidentDraft(active.rule, [_change(time_ns, alert, active)], time_ns)
        if alert.rule is None or alert.event == "standing":
            return
        name = alert.incident or self._name(alert, alert.rule)
        if name is not None:
            draft = self.drafts.setdefault(name, _IncidentDraft(alert.rule, [], time_ns))
            active_now = next((each for each in alert.active if each.rule == alert.rule), None)
            draft.changes.append(_change(time_ns, alert, active_now))
            if alert.event != "acknowledged":  # which may come hours after the end
                draft.last_ns = time_ns

    def _name(self, alert: Alert, rule: str) -> str | None:
        """Return a name for the incident of a message without an id; None where it belongs to none."""
        if alert.event == "raised":
            self.open_names.setdefault(rule, f"{rule} {len(self.drafts) + 1}")
        return self.open_names.pop(rule, None) if alert.event == "cleared" else self.open_names.get(rule)


def find_incidents(alerts: Iterable[tuple[int, Alert]]) -> list[AlertIncident]:
    """Return the incidents of alert messages with their gateway times, in order of time.

    Recordings made before incidents had an id are joined by rule, from raised to cleared.
    """
    reader = _IncidentReader()
    for time_ns, alert in alerts:
        reader.add(time_ns, alert)
    ordered = sorted(reader.drafts.items(), key=lambda item: item[1].changes[0].time_ns)
    return [
        AlertIncident(number, name, draft.rule, tuple(draft.changes), draft.last_ns)
        for number, (name, draft) in enumerate(ordered, 1)
    ]


def _change(time_ns: int, alert: Alert, active: ActiveAlert | None) -> IncidentChange:
    is_own = active is None or active.rule == alert.rule
    return IncidentChange(
        time_ns=time_ns,
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
