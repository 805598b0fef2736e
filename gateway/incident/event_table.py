"""The events of an incident in order of time, as a table."""

from collections.abc import Iterator
from dataclasses import dataclass

from gateway.documents.format import as_sentence, format_fixed, human_name, printable_text
from gateway.incident.course import Course
from gateway.incident.evidence import IncidentEvidence
from gateway.incident.gateway_runs import StateCourse
from gateway.incident.incident_summary import restart_text, where_it_stood
from gateway.incident.setting_changes import MAX_WORDS_CHARACTERS
from gateway.incident.timeline_figure import ReportClock

ALERT, MARK, END = "alert", "mark", "recordings"
ALWAYS_SHOWN = (ALERT, MARK, END)
MAX_SHOWN_EVENTS = 120
"""Basis: a choice; two or three printed pages."""
MIN_STATE_S = 1.0
"""A condition that lasted shorter is left out. Basis: two verdicts."""


@dataclass(frozen=True, slots=True)
class EventRow:
    """A row of the table."""

    utc: str
    local: str
    kind: str
    text: str
    is_alert: bool


@dataclass(frozen=True, slots=True)
class EventTable:
    """The rows, and how many did not fit."""

    rows: tuple[EventRow, ...]
    hidden: int
    zone: str


def event_table(evidence: IncidentEvidence) -> EventTable:
    """Return the events; alerts, marks and the end of the recordings are always shown."""
    course, clock = evidence.course, ReportClock(evidence.course)
    found = sorted(_events(evidence, course), key=lambda event: event[0])
    inside = [event for event in found if course.begin_s <= event[0] <= course.end_s]
    room = max(0, MAX_SHOWN_EVENTS - sum(kind in ALWAYS_SHOWN for _, kind, _ in inside))
    shown = []
    for event in inside:
        room -= event[1] not in ALWAYS_SHOWN
        if event[1] in ALWAYS_SHOWN or room >= 0:
            shown.append(_row(clock, *event))
    return EventTable(tuple(shown), len(inside) - len(shown), clock.zone(course.begin_s))


def _row(clock: ReportClock, time_s: float, kind: str, text: str) -> EventRow:
    return EventRow(
        utc=clock.time(time_s),
        local=clock.time(time_s, is_local=True),
        kind=kind,
        text=printable_text(text, MAX_WORDS_CHARACTERS),
        is_alert=kind == ALERT,
    )


def _events(evidence: IncidentEvidence, course: Course) -> Iterator[tuple[float, str, str]]:
    """Yield (time, kind, text)."""
    incidents = [evidence.window.incident, *evidence.window.others]
    told = set()
    for incident in incidents:
        for change in () if incident is None else incident.changes:
            told.add(change.text)
            yield course.time_s(change.time_ns), ALERT, as_sentence(change.text)
        if incident is not None and incident.cleared_ns is None and (words := where_it_stood(course, incident)):
            yield course.time_s(incident.last_ns), ALERT, f"The {incident.rule} alert {words} [incident {incident.id}]."
    yield from _state_events("condition", course.condition, course)
    yield from _gateway_events(course)
    yield from _state_events("clock", course.clock, course)
    for time_s in course.clock_steps_s:
        yield time_s, "clock", "The wall clock stepped."
    for index, (time_s, calibration) in enumerate(course.calibrations):
        verb = "Calibration in force" if index == 0 else "Another calibration in force"
        yield max(time_s, course.begin_s), "calibration", f"{verb}: {calibration.text}."
    yield from ((each.time_s, MARK, each.text) for each in course.marks)
    yield from ((each.time_s, "calibration", as_sentence(each.text)) for each in course.sessions)
    for gap in course.samples.gaps:
        yield gap.begin_s, "samples", f"No samples for {gap.end_s - gap.begin_s:.3f} s: {gap.cause}."
    for line in course.log:
        if line.text not in told:
            yield line.time_s, "log", line.text


def _gateway_events(course: Course) -> Iterator[tuple[float, str, str]]:
    yield from _state_events("gateway", course.health, course)
    yield from ((each.time_s, "gateway", as_sentence(each.text)) for each in course.faults)
    for restart in course.restarts:
        yield restart.stopped_s, "gateway", restart_text(ReportClock(course), restart)
    if course.end_cause:
        yield course.end_s, END, f"{course.end_cause}."
    for change in course.setting_changes:
        yield change.time_s, "settings", f"Another configuration in force: {change.words}."


def _state_events(kind: str, states: StateCourse, course: Course) -> Iterator[tuple[float, str, str]]:
    for from_s, to_s, state in states.spans(course.end_s):
        begin_s, end_s = max(from_s, course.begin_s), min(to_s, course.end_s)
        if end_s - begin_s >= MIN_STATE_S:
            yield begin_s, kind, as_sentence(f"{human_name(state)} for {format_fixed(end_s - begin_s, 1)} s")
