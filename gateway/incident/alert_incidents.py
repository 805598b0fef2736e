"""The incidents in a recording, from the messages of its alerts."""

from collections.abc import Iterable
from dataclasses import dataclass

from gateway.messages import ActiveAlert, Alert, Level

STANDING = "standing"
"""The event of an alert that had been raised before the recordings begin."""
RANK: dict[str, int] = {"unknown": 0, "normal": 0, "warn": 1, "trip": 2}


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


@dataclass(frozen=True, slots=True)
class AlertIncident:
    """The time of one rule from raised to cleared."""

    number: int
    """Within the recordings, from 1 in order of time."""
    id: str
    rule: str
    changes: tuple[IncidentChange, ...]

    @property
    def raised_ns(self) -> int:
        """Gateway time of the first change; the raise itself may be before the recordings."""
        return self.changes[0].time_ns

    @property
    def cleared_ns(self) -> int | None:
        """Gateway time of its end; None where the recordings end before."""
        return self.changes[-1].time_ns if self.changes[-1].event == "cleared" else None

    @property
    def highest(self) -> IncidentChange:
        """The first change to the highest level."""
        return max(self.changes, key=lambda change: (RANK[change.level], -change.time_ns))

    @property
    def level(self) -> Level:
        """The highest level."""
        return self.highest.level


def find_incidents(alerts: Iterable[tuple[int, Alert]]) -> list[AlertIncident]:
    """Return the incidents of alert messages with their gateway times, in order of time.

    Recordings made before incidents had an id are joined by rule, from raised to cleared.
    """
    found: dict[str, tuple[str, list[IncidentChange]]] = {}
    unnamed: dict[str, str] = {}
    for time_ns, alert in alerts:
        for active in alert.active:
            if active.incident is not None and active.incident not in found and active.rule != alert.rule:
                found[active.incident] = (
                    active.rule,
                    [_change(time_ns, alert, active)],
                )  # raised before the recordings
        if alert.rule is None or alert.event == "standing":
            continue
        name = alert.incident or _unnamed(alert, unnamed, len(found))
        if name is not None:
            active_now = next((each for each in alert.active if each.rule == alert.rule), None)
            found.setdefault(name, (alert.rule, []))[1].append(_change(time_ns, alert, active_now))
    ordered = sorted(found.items(), key=lambda item: item[1][1][0].time_ns)
    return [
        AlertIncident(number, name, rule, tuple(changes)) for number, (name, (rule, changes)) in enumerate(ordered, 1)
    ]


def _unnamed(alert: Alert, open_names: dict[str, str], count: int) -> str | None:
    """Return a name for the incident of a message without an id; None where it belongs to none."""
    rule = alert.rule or ""
    if alert.event == "raised" and rule not in open_names:
        open_names[rule] = f"{rule} {count + 1}"
    return open_names.pop(rule, None) if alert.event == "cleared" else open_names.get(rule)


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
    )
