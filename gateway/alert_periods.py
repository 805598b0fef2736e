"""The alerts of a gateway from raised to cleared, folded from what it states of them: live, stored or recorded."""

from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

from gateway.messages import LEVEL_RANK, ActiveAlert, Alert

RAISED = ("warn", "trip")
MAX_ENDED_INCIDENTS = 32
"""Number of incidents that can be acknowledged after their end. Basis: a choice; more than a shift has to acknowledge, and a
bound of the memory."""
SHIFT_NS = 12 * 3600 * 10**9
"""Age at which an ended alert is no longer listed, nor acknowledged after a start. Basis: the longest shift."""
EndReason = Literal["cleared", "unknown", "gateway ended", "not recorded"]


@dataclass(frozen=True, slots=True)
class AlertState:
    """The state of the alerts from one change until the next."""

    log_time_ns: int
    utc_ns: int
    event: str
    """raised, changed, corrected, cleared, acknowledged, or standing for the first message of a segment."""
    rule: str | None
    active: list[ActiveAlert]
    """The active alerts; each value is the largest one until the next change."""
    incident: str | None = None
    """The incident that the change belongs to."""
    largest_deg: float | None = None
    """Largest angle since that incident began, best estimate."""
    largest_upper_deg: float | None = None
    """Largest upper end of its 95 % interval."""
    acknowledged_by: str | None = None
    """Who acknowledged it, in that change."""


S = TypeVar("S", Alert, AlertState)


@dataclass(frozen=True, slots=True)
class AlertStep(Generic[S]):
    """A statement on an alert."""

    time_ns: int
    statement: S
    active: ActiveAlert | None
    """The alert after it; None: it is not active any more."""


@dataclass(slots=True)
class AlertPeriod(Generic[S]):
    """One alert. In recordings made before incidents had an id it has none, and ends when its level is unknown."""

    rule: str
    incident: str | None
    last_ns: int
    """Time of the last statement in which it stood, or of its end."""
    steps: list[AlertStep[S]] = field(default_factory=list)
    """Its changes; before them the first statement on it where it stood already, after them acknowledgements of an end."""
    raised: AlertStep[S] | None = None
    """The first statement with a warning or a trip; None: there was none, as when only its end is stated."""
    highest: ActiveAlert | None = None
    """As it was when its level became the highest."""
    present: ActiveAlert | None = None
    """As it was stated last."""
    largest_deg: float | None = None
    """Largest angle, best estimate."""
    largest_upper_deg: float | None = None
    is_refuted: bool = False
    """The gateway has said that the limit of the highest level was not reached."""
    ended: EndReason | None = None
    """unknown: the level was no longer known; not recorded: its end was not stated; None: it stands."""
    end_ns: int | None = None

    @property
    def acknowledgement(self) -> AlertStep[S] | None:
        """The last acknowledgement, which may come after the end; None: there was none."""
        return next((step for step in reversed(self.steps) if step.statement.event == "acknowledged"), None)

    @property
    def acknowledged(self) -> tuple[str | None, int | None]:
        """Who acknowledged it at its last level, and when, also after its end; None: nobody."""
        late, present = self.acknowledgement, self.present
        if late is not None and late.active is None:
            return late.statement.acknowledged_by, late.time_ns
        return (None, None) if present is None else (present.acknowledged_by, present.acknowledged_ns)

    @property
    def is_seen(self) -> bool:
        """Whether it was followed from its begin until it cleared."""
        return self.ended == "cleared" and self.raised is not None and self.raised.statement.event != "standing"

    @property
    def is_corrected(self) -> bool:
        """Whether the limit of its highest level was not reached, by the gateway's word or by all that it saw."""
        limit_deg = None if self.highest is None else self.highest.limit_deg
        is_below = limit_deg is not None and self.largest_upper_deg is not None and self.largest_upper_deg < limit_deg
        return (self.is_seen and is_below) or self.is_refuted

    def take(self, time_ns: int, statement: S, alert: ActiveAlert) -> None:
        """Take a statement in which it is active."""
        step = AlertStep(time_ns, statement, alert)
        if not self.steps and statement.rule != self.rule:
            self.steps.append(step)
        self.present, self.last_ns, self.ended, self.end_ns = alert, time_ns, None, None
        self.enlarge(alert)
        if alert.level in RAISED:
            self.raised = self.raised or step
            if self.highest is None or LEVEL_RANK[alert.level] > LEVEL_RANK[self.highest.level]:
                self.highest, self.is_refuted = alert, False

    def change(self, step: AlertStep[S]) -> None:
        """Take a change of its own."""
        self.steps.append(step)
        self.is_refuted |= step.statement.event == "corrected"
        if step.statement.event != "acknowledged":  # which may come hours after the end
            self.last_ns = step.time_ns
        if step.statement.event == "cleared" and self.ended == "not recorded":  # another change at this time came first
            self.ended, self.end_ns = "cleared", step.time_ns
            self.enlarge(step.statement)

    def enlarge(self, stated: ActiveAlert | S) -> None:
        """Take the largest angle that is stated of it."""
        self.largest_deg = _larger(self.largest_deg, stated.largest_deg)
        self.largest_upper_deg = _larger(self.largest_upper_deg, stated.largest_upper_deg)

    def end_reason(self, alert: ActiveAlert | None, rule: str | None) -> EndReason | None:
        """Return why it ends where `alert` of its rule is active after a change of `rule`; None: it goes on."""
        if alert is not None and alert.level in RAISED:
            return (
                None if None in (self.incident, alert.incident) or alert.incident == self.incident else "not recorded"
            )
        if alert is not None and self.incident is not None and alert.incident == self.incident:
            return None
        if rule == self.rule:
            return "cleared"
        return "not recorded" if alert is None else "unknown"


class AlertPeriods(Generic[S]):
    """The alerts in the order of the first statements on them."""

    def __init__(self) -> None:
        self.all: list[AlertPeriod[S]] = []
        self._open: dict[str, AlertPeriod[S]] = {}
        """By rule."""
        self._by_incident: dict[str, AlertPeriod[S]] = {}

    def add(self, time_ns: int, statement: S) -> None:
        """Take a statement: begin, continue, acknowledge and end alerts."""
        active = {alert.rule: alert for alert in statement.active}
        changed = self._changed(statement)
        self._end(time_ns, statement, active)
        for rule, alert in active.items():
            if alert.incident is not None or alert.level in RAISED:
                known = self._open.get(rule) or self._by_incident.get(alert.incident or "")
                self._open[rule] = known or self._begin(rule, alert.incident, time_ns)
                self._open[rule].take(time_ns, statement, alert)
        if statement.event == "standing":
            return
        changed = changed or self._changed(statement)
        if changed is None and statement.incident is not None and statement.rule is not None:
            changed = self._begin(statement.rule, statement.incident, time_ns)
            changed.ended, changed.end_ns = "not recorded", time_ns
        if changed is not None:
            present = active.get(changed.rule) if self._open.get(changed.rule) is changed else None
            changed.change(AlertStep(time_ns, statement, present))

    def _end(self, time_ns: int, statement: S, active: dict[str, ActiveAlert]) -> None:
        """End the alerts that do not go on."""
        for rule, period in list(self._open.items()):
            period.ended = period.end_reason(active.get(rule), statement.rule)
            if period.ended is not None:
                period.end_ns = time_ns
                del self._open[rule]
            if period.ended == "cleared":
                period.enlarge(statement)

    def end_boot(self, time_ns: int) -> None:
        """End all alerts: the gateway started again, and knows nothing of them."""
        for period in self._open.values():
            period.ended, period.end_ns = "gateway ended", time_ns
        self._open.clear()

    def forget_first(self) -> None:
        """Forget the first alert."""
        self._by_incident.pop(self.all.pop(0).incident or "", None)

    def _changed(self, statement: S) -> AlertPeriod[S] | None:
        """Return the known alert that a statement changes."""
        if statement.incident is not None:
            return self._by_incident.get(statement.incident)
        period = self._open.get(statement.rule or "")
        return None if period is None or period.incident is not None else period

    def _begin(self, rule: str, incident: str | None, time_ns: int) -> AlertPeriod[S]:
        period = AlertPeriod[S](rule, incident, time_ns)
        self.all.append(period)
        if incident is not None:
            self._by_incident[incident] = period
        return period


def _larger(first: float | None, second: float | None) -> float | None:
    return max((value for value in (first, second) if value is not None), default=None)
