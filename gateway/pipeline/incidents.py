"""Incidents: the time of a rule from raised to cleared, with an id, and the check of a first value that was an upper bound.

Also the alerts in the words of an operator: a line for each rule that is not normal, and a line for each change.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from gateway.alert_periods import MAX_ENDED_INCIDENTS, SHIFT_NS, AlertPeriods
from gateway.messages import Alert, AlertEventKind, Level
from gateway.stages.alerts import GRACE_S, Reading
from gateway.units import degrees

CHECK_S = 2.0
"""Time after the expected peak until a bound is refuted. Basis: a third of the period of a rope of 9 m."""
OFFLINE = "offline"
"""The boot id of a pipeline outside a gateway."""
MIN_LEAD_S = 0.05
"""A peak that comes sooner is the present angle. Definition: the resolution of the text."""


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """A person has taken note of an incident."""

    incident: str
    by: str
    reason: str = ""


@dataclass(slots=True)
class Incident:
    """One incident of a rule; `raised_s` and the first reading are those of its last raise to a higher level."""

    id: str
    rule: str
    begin_s: float
    limit_rad: float
    first: Reading | None
    raised_s: float
    largest_rad: float = 0.0
    """Largest best estimate of the present angle since the begin."""
    largest_upper_rad: float = 0.0
    """Largest upper end of its 95 % interval."""
    known_s: float = -math.inf
    is_seen_throughout: bool = True
    """The present angle was known all the time."""
    is_refuted: bool = False
    """The first reading was an upper bound, and the angle stayed below the limit."""
    acknowledged_by: str | None = None
    """Who acknowledged its present level; None: nobody."""
    acknowledged_ns: int | None = None
    """Gateway time of the acknowledgement."""

    def add(self, reading: Reading | None, time_s: float) -> None:
        """Take the reading of one time."""
        if reading is None or not math.isfinite(reading.value_rad):
            self.is_seen_throughout &= time_s - self.known_s <= GRACE_S
            return
        present = reading.now
        self.known_s = time_s
        self.largest_rad = max(self.largest_rad, present.best_rad)
        self.largest_upper_rad = max(self.largest_upper_rad, present.upper_rad)

    def refutes(self, reading: Reading | None, time_s: float) -> bool:
        """Return whether the first bound is now known to be wrong: its time has passed, and nothing reached the limit."""
        if self.first is None or self.is_refuted or not self.first.is_bound(self.limit_rad) or reading is None:
            return False
        is_due = time_s >= self.raised_s + self.first.expected_in_s + CHECK_S
        is_below = max(reading.upper_rad, self.largest_upper_rad) < self.limit_rad
        return is_due and is_below and self.is_seen_throughout


def unacknowledged_incidents(stored: Iterable[Alert]) -> Iterator[Incident]:
    """Yield the incidents of former runs that nobody has acknowledged, from their stored changes, within a shift of the last.

    One that stood when its gateway ended has ended with it.
    """
    periods, newest = AlertPeriods[Alert](), None
    for alert in stored:
        if newest is not None and alert.boot_id != newest.boot_id:
            periods.end_boot(alert.time_ns)
        periods.add(alert.time_ns, alert)
        newest = alert
    for period in periods.all:
        is_new = newest is not None and newest.time_ns - period.last_ns < SHIFT_NS
        if is_new and period.incident is not None and period.highest is not None and period.acknowledged[0] is None:
            yield past_incident(period.incident, period.rule, period.highest.limit_deg, period.last_ns)


def past_incident(incident_id: str, rule: str, limit_deg: float | None, time_ns: int) -> Incident:
    """Return an incident of a former run, of which this one knows no angles."""
    limit_rad = math.nan if limit_deg is None else math.radians(limit_deg)
    return Incident(incident_id, rule, time_ns / 1e9, limit_rad, None, time_ns / 1e9)


class IncidentRegister:
    """Numbers the incidents of a boot and the changes of alerts; it outlives the pipeline, which a recalibration replaces."""

    def __init__(self, boot_id: str = OFFLINE, last_number: int | None = None) -> None:
        """`boot_id` makes the ids unique across boots; changes are numbered from behind `last_number`, or not if it is None."""
        self.boot_id = boot_id
        self.last_number = last_number
        """Number of the last change."""
        self._count = 0
        self._open: dict[str, Incident] = {}
        self._ended: deque[Incident] = deque(maxlen=MAX_ENDED_INCIDENTS)

    def remember(self, past: Iterable[Incident]) -> None:
        """Take incidents of former runs, which can be acknowledged; called before the first of this one ends."""
        self._ended.extend(past)

    def number_change(self, rule: str | None) -> None:
        """Give the next number to the change of a rule; a heartbeat, of no rule, keeps that of the last change."""
        if self.last_number is not None and rule is not None:
            self.last_number += 1

    def unacknowledged(self) -> Iterator[str]:
        """Yield the ids of the incidents that nobody has acknowledged, those that have ended first."""
        for incident in (*self._ended, *self._open.values()):
            if incident.acknowledged_by is None:
                yield incident.id

    def was_raised_after(self, incident_id: str, time_ns: int) -> bool:
        """Return whether the present level of an incident came after a gateway time."""
        incident = self.find(incident_id)
        return incident is not None and incident.raised_s > time_ns / 1e9

    def find(self, incident_id: str) -> Incident | None:
        """Return an incident that is open, or that has ended lately; None where there is none with this id."""
        return next((each for each in (*self._ended, *self._open.values()) if each.id == incident_id), None)

    def get(self, rule: str) -> Incident | None:
        """Return the incident of a rule; None: there is none."""
        return self._open.get(rule)

    def update(
        self,
        rule: str,
        event: AlertEventKind,
        level: Level,
        reading: Reading | None,
        limit_rad: float,
        time_s: float,
        *,
        is_untrusted: bool = False,
    ) -> tuple[AlertEventKind, Incident | None]:
        """Take the event of a rule and its reading; return the event as it is reported, and its incident.

        A reading that is not trusted can raise an alert, and states no largest angle. A rule that returns to normal clears its
        incident, also from unknown. `limit_rad` is that of the present level.
        """
        incident = self._open.get(rule)
        if event == "raised":
            incident = self._raise(rule, incident, reading, limit_rad, time_s)
        if incident is None:
            return event, None
        incident.add(None if is_untrusted else reading, time_s)
        if level == "normal":
            self._ended.append(self._open.pop(rule))
            return "cleared", incident
        if event == "standing" and incident.refutes(reading, time_s):
            incident.is_refuted = True
            return "corrected", incident
        return event, incident

    def _raise(
        self, rule: str, incident: Incident | None, reading: Reading | None, limit_rad: float, time_s: float
    ) -> Incident:
        if incident is None:
            self._count += 1
            incident = Incident(f"{self.boot_id}-{self._count}", rule, time_s, limit_rad, reading, time_s)
            self._open[rule] = incident
        incident.limit_rad, incident.first, incident.raised_s, incident.is_refuted = limit_rad, reading, time_s, False
        incident.acknowledged_by = incident.acknowledged_ns = None  # of a lower level
        return incident


def reading_text(reading: Reading | None, limit_rad: float) -> str:
    """Return `up to 6.4 deg now`; a bound at or above the limit is said to be one, with the best estimate of the angle."""
    value_deg = None if reading is None else degrees(reading.value_rad)
    if reading is None or value_deg is None:
        return "not known now"
    when = "now" if reading.expected_in_s < MIN_LEAD_S else f"expected in {reading.expected_in_s:.1f} s"
    text = f"up to {value_deg:.1f} deg {when}"
    if reading.value_rad >= limit_rad and reading.is_bound(limit_rad):
        text += f", an upper bound, angle now {math.degrees(reading.now.best_rad):.1f} deg"
    return text


def limits_text(limit_rad: float, clear_rad: float) -> str:
    """Return the limit of a level and the clear level."""
    return f"limit {math.degrees(limit_rad):.1f} deg, clears below {math.degrees(clear_rad):.1f} deg"


def refuted_text(incident: Incident) -> str:
    """Return that the first value of an incident was a bound, and what the angle was."""
    return f"limit {math.degrees(incident.limit_rad):.1f} deg was not reached: {largest_text(incident)}"


def largest_text(incident: Incident) -> str:
    """Return the largest angle of an incident with the upper end of its interval."""
    if incident.known_s == -math.inf:
        return "angle not known"
    known = "angle" if incident.is_seen_throughout else "known angle"
    largest_deg, upper_deg = math.degrees(incident.largest_rad), math.degrees(incident.largest_upper_rad)
    return f"largest {known} {largest_deg:.1f} deg, at most {upper_deg:.1f} deg"


def change_text(
    rule: str, event: AlertEventKind, level: Level, description: str, incident: Incident | None, time_s: float
) -> str:
    """Return the line of one change; `description` is what the present reading or its reason says, with the limits."""
    match event:
        case "raised":
            text = f"{rule} raised to {level}: {description}"
        case "cleared" if incident is not None:
            text = f"{rule} cleared after {time_s - incident.begin_s:.1f} s: {_course_text(incident)}"
        case "corrected" if incident is not None:
            text = f"{rule} {level} corrected: {refuted_text(incident)}; the first value was an upper bound"
        case _:
            text = f"{rule} changed to {level}" + (f": {description}" if description else "")
    return text if incident is None else f"{text} [incident {incident.id}]"


def acknowledged_text(acknowledgement: Acknowledgement, incident: Incident) -> str:
    """Return the line of an acknowledgement."""
    reason = f": {acknowledgement.reason}" if acknowledgement.reason else ""
    return f"{incident.rule} acknowledged by {acknowledgement.by}{reason} [incident {incident.id}]"


def _course_text(incident: Incident) -> str:
    if incident.first is None:
        return "the cause has ended"
    if incident.is_refuted:
        return refuted_text(incident)
    return f"{largest_text(incident)} (limit {math.degrees(incident.limit_rad):.1f} deg)"
