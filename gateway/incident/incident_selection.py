"""The incidents in recordings, from the messages of their alerts, and the choice of one, with the time around it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile

from gateway.alert_periods import AlertPeriods, AlertState, AlertStep
from gateway.errors import InputError, counted
from gateway.messages import LEVEL_RANK, Alert, Level
from gateway.recording.chain.missing_files import describe_hidden
from gateway.recording.format.content import CUT, segment_number
from gateway.recording.format.salvage import describe_losses, may_hide_messages
from gateway.recording.reading.interval import RecordingInterval, RecordingTime, iso_utc
from gateway.recording.reading.recording_file import Selection, open_recording
from gateway.recording.reading.timeline import ReportProgress, Timeline, TimelineSpan, ignore_progress

STANDING = "standing"
"""The event of an alert that had been raised before the recordings begin."""
ALERTS = frozenset({"/alert"})
MAX_REPORT_S = 4 * 3600.0
"""Longest time of a report. Basis: a choice; an incident is shorter, and a longer span needs more memory than a laptop has to
spare."""


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
    expected_in_s: float | None = None
    """Time until `value_deg` is reached: that of a coming peak, 0 for the angle at that time; None: not stated."""
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
    stood_ns: int | None
    """Gateway time from which on it had stood by its first message, where that is not its raise; None: it is, or says nothing."""
    largest_deg: float | None
    """Largest angle by the gateway itself, also of what is not in the recordings; best estimate."""
    largest_upper_deg: float | None
    """Largest upper end of its 95 % interval."""

    def is_changed_by(self, message: Alert | None) -> bool:
        """Return whether a message at the time of a change is of it; it may be a heartbeat, or have no id."""
        own = (self.rule, self.id), (self.rule, None), (None, None)
        return message is not None and (message.rule, message.incident) in own

    @property
    def is_acknowledgement_alone(self) -> bool:
        """Nothing but acknowledgements is in the recordings, and none of them states it as standing."""
        return all(change.event == "acknowledged" and change.level == "normal" for change in self.changes)

    @property
    def is_raised_before(self) -> bool:
        """Its raise is not in the recordings: before them, or in a gap."""
        return self.changes[0].event != "raised"

    @property
    def raised_ns(self) -> int:
        """Gateway time of its raise, or the earliest one at which it is known to have stood."""
        return self.changes[0].time_ns if self.stood_ns is None else self.stood_ns

    @property
    def cleared_ns(self) -> int | None:
        """Gateway time of its end; None where the recordings have none: they end, or the gateway was stopped."""
        return next((change.time_ns for change in reversed(self.changes) if change.event == "cleared"), None)

    @property
    def unknown_ns(self) -> int | None:
        """Gateway time from which on its level was not known, to the last message of it; None: it was known, or it ended."""
        unknown = list(takewhile(lambda change: change.level == "unknown", reversed(self.changes)))
        return unknown[-1].time_ns if unknown else None

    @property
    def acknowledgements(self) -> tuple[IncidentChange, ...]:
        """The acknowledgements in order of time, which may come after the end."""
        return tuple(change for change in self.changes if change.acknowledged_by is not None)

    @property
    def rises(self) -> tuple[IncidentChange, ...]:
        """The changes by which the alert was raised to its highest level; the first one may be a heartbeat that states it."""
        highest = self.highest
        later = (each for each in self.changes if each.event == "raised" and each.level == highest.level)
        return highest, *(each for each in later if each.time_ns > highest.time_ns)

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
            _stood_ns(period.steps[0]),
            period.largest_deg,
            period.largest_upper_deg,
        )
        for number, period in enumerate(ordered, 1)
    ]


def _stood_ns(first: AlertStep[Alert]) -> int | None:
    active = first.active
    return None if active is None or active.rule == first.statement.rule else min(active.since_ns, first.time_ns)


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
        expected_in_s=None if active is None else active.expected_in_s,
        acknowledged_by=alert.acknowledged_by if is_own else None,
        reason=alert.reason if is_own else None,
    )


@dataclass(frozen=True, slots=True)
class IncidentChoice:
    """What the user asks for: one of the three, or nothing, which is the last incident."""

    around: RecordingTime | None = None
    alert: str | None = None
    """Its number within the recordings, or its id."""
    interval: RecordingInterval | None = None


@dataclass(frozen=True, slots=True)
class IncidentWindow:
    """The time of a report in gateway time, with its incident; None: no alert was raised in it."""

    begin_ns: int
    end_ns: int
    origin_ns: int
    """The raise of the incident, or the time that was asked for."""
    incident: AlertIncident | None
    others: tuple[AlertIncident, ...]
    """Other incidents in the same time, and of the same rule one before it that has no end, or one after it if it has none."""
    is_shortened: bool = False
    asked_ns: int | None = None
    """The time that was asked for, where no incident is stated to have stood then."""
    hidden: tuple[str, ...] = ()
    """What could not be read of the recordings, or is missing: other incidents may have been in it."""


def read_incidents(
    timeline: Timeline, report: ReportProgress = ignore_progress, hidden: list[str] | None = None
) -> list[AlertIncident]:
    """Return the incidents of a timeline in order of time. Raises `RecordingError`.

    `hidden` takes a line for each file and each hole in which others may have been.
    """
    hidden = [] if hidden is None else hidden
    found = find_incidents(_read_alerts(timeline, report, hidden))
    hidden += describe_hidden(timeline)
    return found


def choose_window(
    timeline: Timeline, incidents: Sequence[AlertIncident], choice: IncidentChoice, margin_s: float
) -> IncidentWindow:
    """Return the time of the report, `margin_s` before and after the incident. Raises `InputError`."""
    span = timeline.span()
    if choice.interval is not None:
        selection = timeline.select(choice.interval)
        begin_ns = span.first_ns if selection.begin_ns is None else selection.begin_ns
        end_ns = span.last_ns if selection.end_ns is None else selection.end_ns
        return _window(span, incidents, _worst(_within(incidents, begin_ns, end_ns)), begin_ns, end_ns)
    margin_ns = round(margin_s * 1e9)
    if choice.around is not None:
        around_ns = span.first_ns + round(choice.around.time_s(span.extent) * 1e9)
        if not span.first_ns - margin_ns <= around_ns <= span.last_ns + margin_ns:
            raise InputError(f"--around {choice.around.text}: is outside the recording, which is {span.extent}")
        begin_ns, end_ns = around_ns - margin_ns, around_ns + margin_ns
        incident = _nearest(_within(incidents, begin_ns, end_ns), around_ns)
        window = _window(span, incidents, incident, begin_ns, end_ns, around_ns if incident is None else None)
        is_beside = incident is None or not incident.raised_ns <= around_ns <= incident.last_ns
        return replace(window, asked_ns=around_ns if is_beside else None)
    incident = _chosen(timeline, incidents, choice)
    return _window(span, incidents, incident, incident.raised_ns - margin_ns, incident.last_ns + margin_ns)


def _chosen(timeline: Timeline, incidents: Sequence[AlertIncident], choice: IncidentChoice) -> AlertIncident:
    if not incidents:
        raise InputError(f"{timeline.name}: no alert was raised in it; give --around TIME, or --from and --to")
    if choice.alert is None:
        cut_out = {each.metadata.get(CUT, {}).get("incident") for each in timeline.segments}
        return next((each for each in incidents if each.id in cut_out), incidents[-1])
    found = next((each for each in incidents if choice.alert in (str(each.number), each.id)), None)
    if found is None:
        has = f"{counted(len(incidents), 'incident')}, numbered from 1; --list has their ids too"
        raise InputError(f"--alert {choice.alert}: there is none in {timeline.name}, which has {has}")
    return found


def _window(
    span: TimelineSpan,
    incidents: Sequence[AlertIncident],
    incident: AlertIncident | None,
    begin_ns: int,
    end_ns: int,
    origin_ns: int | None = None,
) -> IncidentWindow:
    begin_ns, end_ns = max(begin_ns, span.first_ns), min(end_ns, span.last_ns)
    latest_ns = begin_ns + round(MAX_REPORT_S * 1e9)
    near = [*_within(incidents, begin_ns, min(end_ns, latest_ns)), *_linked(incidents, incident)]
    others = tuple(each for each in incidents if each in near and each is not incident)
    if origin_ns is None:
        origin_ns = begin_ns if incident is None else incident.raised_ns
    return IncidentWindow(begin_ns, min(end_ns, latest_ns), origin_ns, incident, others, end_ns > latest_ns)


def _within(incidents: Sequence[AlertIncident], begin_ns: int, end_ns: int) -> list[AlertIncident]:
    return [each for each in incidents if each.raised_ns <= end_ns and each.last_ns >= begin_ns]


def _linked(incidents: Sequence[AlertIncident], incident: AlertIncident | None) -> list[AlertIncident]:
    """Return the incident before one where it has no end, and the one after it where it has none itself."""
    same = [each for each in incidents if incident is not None and each.rule == incident.rule]
    return [
        other
        for before, after in pairwise(same)
        for other in (before, after)
        if before.cleared_ns is None and incident in (before, after)
    ]


def _nearest(incidents: Sequence[AlertIncident], time_ns: int) -> AlertIncident | None:
    """Return the incident in which a time lies, of several the worst, or else the nearest one."""
    if (inside := _worst(_within(incidents, time_ns, time_ns))) is not None:
        return inside
    return min(incidents, key=lambda each: max(each.raised_ns - time_ns, time_ns - each.last_ns), default=None)


def _worst(incidents: Sequence[AlertIncident]) -> AlertIncident | None:
    """Return the first incident of the highest level."""
    trips = [each for each in incidents if each.level == "trip"]
    return next(iter(trips or incidents), None)


def _read_alerts(timeline: Timeline, report: ReportProgress, hidden: list[str]) -> Iterator[tuple[int, Alert]]:
    """Yield the messages of alerts; segments in which none stood and nothing changed, by their summaries, are left out.

    `hidden` takes a line for each file of which messages cannot be read, or before whose messages changes of alerts are missing
    that no hole in the segments explains.
    """
    done, total = 0, max(timeline.size_bytes, 1)
    newest: int | None = None
    segment_before, offset_ns = 0, timeline.span().wall_offset_ns
    for segment in timeline.segments:
        summary, number = segment.summary, segment_number(segment.origin)
        newest, segment_before = newest if number == segment_before + 1 else None, number
        if summary is None or any(map(_is_eventful, summary.alerts)):
            file = open_recording(segment.path)
            for recorded in file.messages(Selection(topics=ALERTS)):
                content = file.decode(recorded)
                if isinstance(content, Alert):
                    if missing := _missing_changes(newest, content):
                        hidden.append(
                            f"{segment.path.name}: {missing} before {iso_utc(recorded.log_time_ns + offset_ns)}"
                        )
                    newest = content.alert_number
                    yield recorded.log_time_ns, content
            if may_hide_messages(file.losses):
                hidden.append(f"{segment.path.name}: {', '.join(describe_losses(file.losses))}")
        done += segment.size_bytes
        report(done / total)


def _missing_changes(newest: int | None, alert: Alert) -> str:
    """Return which numbered changes are missing between the newest one, None: not known, and a message; empty: none."""
    before = (alert.alert_number or 0) - (alert.rule is not None)
    if newest is None or before <= newest or alert.clock == "replayed":
        return ""
    which = (
        f"change {before} of alerts is" if before == newest + 1 else f"changes {newest + 1} to {before} of alerts are"
    )
    return f"{which} missing"


def _is_eventful(state: AlertState) -> bool:
    stands = (active.level in ("warn", "trip") or active.incident is not None for active in state.active)
    return state.event != "standing" or any(stands)
