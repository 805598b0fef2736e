"""The making of a segment's summary, message by message; the alerts of a timeline, which may end in another segment."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal

from gateway import messages
from gateway.alert_periods import AlertPeriod, AlertPeriods, AlertState, EndReason
from gateway.recording.format.segment_summary import (
    SUMMARY_VERSION,
    CalibrationState,
    ClockChange,
    FaultCount,
    LogLine,
    RecordedMark,
    RecordedPeak,
    SampleCounter,
    SegmentSummary,
    TopicCount,
    calibration_key,
)

MAX_LISTED_ENTRIES = 1000
"""Most entries of the lists of faults and of lines, so that a fault that returns every second does not fill the disk. Basis: a
choice; days of rare faults, and some hundred kilobytes."""
WARNING_LEVEL = 3
"""Lowest level of the lines of the log that the summary has. Definition: `foxglove.Log`."""
MAX_VERDICT_S = 2.0
"""A verdict counts no longer than this, in case no other condition follows it. Basis: four periods of the conditions."""


@dataclass(slots=True)
class SummaryBuilder:
    """The summary of the messages so far."""

    _from_ns: int | None = None
    _to_ns: int = 0
    _counts: Counter[str] = field(default_factory=Counter)
    _bytes: Counter[str] = field(default_factory=Counter)
    _samples: SampleCounter = field(default_factory=SampleCounter)
    _alerts: list[AlertState] = field(default_factory=list)
    _calibrations: list[CalibrationState] = field(default_factory=list)
    _clock: list[ClockChange] = field(default_factory=list)
    _last_clock: ClockChange | None = None
    _faults: list[FaultCount] = field(default_factory=list)
    _fault_counts: dict[str, int] = field(default_factory=dict)
    _log: list[LogLine] = field(default_factory=list)
    _log_count: int = 0
    _marks: list[RecordedMark] = field(default_factory=list)
    _swing: RecordedPeak | None = None
    _angle: RecordedPeak | None = None
    _verdict_s: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    _condition: tuple[int, str] | None = None
    """Gateway time and verdict of the last condition."""

    def count(self, topic: str, log_time_ns: int, n_bytes: int) -> None:
        """Count a message of a topic, given with its slash."""
        self._counts[topic] += 1
        self._bytes[topic] += n_bytes
        if self._from_ns is None:
            self._from_ns = self._to_ns = log_time_ns
        elif log_time_ns > self._to_ns:
            self._to_ns = log_time_ns
        elif log_time_ns < self._from_ns:
            self._from_ns = log_time_ns

    def add(self, message: object, log_time_ns: int) -> None:
        """Note the content of a message."""
        match message:
            case messages.Samples():
                self._samples.add(message, log_time_ns)
            case messages.Motion() | messages.Swing():
                self._add_angle(message)
            case messages.Condition():
                self._add_condition(message.verdict, log_time_ns)
            case messages.Alert():
                self._add_alert(message, log_time_ns)
            case messages.Health():
                self._add_health(message)
            case messages.Calibration():
                self._add_calibration(message, log_time_ns)
            case messages.ClockOffset():
                self._add_clock(message, log_time_ns)
            case messages.Log():
                self._add_line(message)
            case messages.Mark():
                self._marks.append(RecordedMark(message.time_ns, message.by, message.text, message.reason))
            case _:
                pass

    def summary(self) -> SegmentSummary | None:
        """Return the summary; None without a message."""
        if self._from_ns is None:
            return None
        last = self._last_clock
        clock = self._clock if last is None or last in self._clock else [*self._clock, last]
        return SegmentSummary(
            version=SUMMARY_VERSION,
            from_ns=self._from_ns,
            to_ns=self._to_ns,
            topics={name: TopicCount(count, self._bytes[name]) for name, count in sorted(self._counts.items())},
            samples=self._samples.summary(),
            alerts=self._alerts,
            calibrations=self._calibrations,
            clock=clock,
            faults=self._faults,
            log=self._log,
            log_count=self._log_count,
            largest_swing=self._swing,
            largest_angle=self._angle,
            verdict_s=dict(self._verdict_s),
            marks=self._marks,
        )

    def _add_angle(self, message: messages.Motion | messages.Swing) -> None:
        if isinstance(message, messages.Motion):
            self._angle = _larger(self._angle, message.time_ns, message.angle_deg, message.u_deg)
        elif message.swinging:
            self._swing = _larger(self._swing, message.time_ns, message.phi_max_deg, message.u_deg)

    def _add_condition(self, verdict: str, log_time_ns: int) -> None:
        if self._condition is not None:
            before_ns, before = self._condition
            self._verdict_s[before] += min(max(log_time_ns - before_ns, 0) / 1e9, MAX_VERDICT_S)
        self._condition = log_time_ns, verdict

    def _add_alert(self, alert: messages.Alert, log_time_ns: int) -> None:
        """Note a change with all active alerts; a heartbeat only raises the largest values of the last state."""
        if alert.event != "standing" or not self._alerts:
            state = AlertState(
                log_time_ns=log_time_ns,
                utc_ns=alert.time_ns,
                event=alert.event,
                rule=alert.rule,
                active=alert.active,
                incident=alert.incident,
                largest_deg=alert.largest_deg,
                largest_upper_deg=alert.largest_upper_deg,
                acknowledged_by=alert.acknowledged_by,
            )
            self._alerts.append(state)
            return
        now = {active.rule: active for active in alert.active}
        state = self._alerts[-1]
        largest = [_with_largest_values(one, now.get(one.rule)) for one in state.active]
        if largest != state.active:
            self._alerts[-1] = replace(state, active=largest)

    def _add_health(self, health: messages.Health) -> None:
        dropped = {f"dropped by the {name}": count for name, count in health.dropped.items()}
        for name, count in {**health.faults, **dropped}.items():
            if count != self._fault_counts.get(name, 0):
                self._fault_counts[name] = count
                if len(self._faults) < MAX_LISTED_ENTRIES:
                    self._faults.append(FaultCount(health.time_ns, name, count))

    def _add_calibration(self, message: messages.Calibration, log_time_ns: int) -> None:
        session = message.session
        state = CalibrationState(
            log_time_ns=log_time_ns,
            utc_ns=message.time_ns,
            calibration_id=message.calibration_id,
            status=message.status,
            text=message.text,
            phase=session.phase,
            by=session.by,
            session_text=session.text,
        )
        if not self._calibrations or calibration_key(self._calibrations[-1]) != calibration_key(state):
            self._calibrations.append(state)

    def _add_clock(self, clock: messages.ClockOffset, log_time_ns: int) -> None:
        change = ClockChange(log_time_ns, clock.clock, clock.wall_offset_ns, clock.stepped)
        last, self._last_clock = self._last_clock, change
        if last is None or last.quality != change.quality or change.stepped:
            self._clock.append(change)

    def _add_line(self, line: messages.Log) -> None:
        if line.level < WARNING_LEVEL:
            return
        self._log_count += 1
        if len(self._log) < MAX_LISTED_ENTRIES:
            utc_ns = line.timestamp.sec * 1_000_000_000 + line.timestamp.nsec
            self._log.append(LogLine(utc_ns, line.level, line.name, line.message))


def _with_largest_values(alert: messages.ActiveAlert, now: messages.ActiveAlert | None) -> messages.ActiveAlert:
    """Return an active alert with the larger values of two messages."""
    if now is None:
        return alert
    return replace(
        alert,
        value_deg=_largest(alert.value_deg, now.value_deg),
        estimate_deg=_largest(alert.estimate_deg, now.estimate_deg),
        largest_deg=_largest(alert.largest_deg, now.largest_deg),
        largest_upper_deg=_largest(alert.largest_upper_deg, now.largest_upper_deg),
    )


def _largest(first: float | None, second: float | None) -> float | None:
    known = [value for value in (first, second) if value is not None]
    return max(known, default=None)


def _larger(
    largest: RecordedPeak | None, time_ns: int, angle_deg: float | None, u_deg: float | None
) -> RecordedPeak | None:
    if angle_deg is None or (largest is not None and largest.phi_max_deg >= angle_deg):
        return largest
    return RecordedPeak(time_ns, angle_deg, u_deg)


@dataclass(frozen=True, slots=True)
class RecordedAlert:
    """One alert."""

    rule: str
    level: str
    """The highest level: trip or warn."""
    from_utc_ns: int
    to_utc_ns: int | None
    """None: it has no end in the recording."""
    is_raised_before: bool
    """It was raised before the recording begins, or in a part that is missing."""
    ended: EndReason | Literal["standing"]
    """unknown: the angle was no longer known; not recorded: it cleared in a gap; standing: the recording ends before it."""
    largest_deg: float | None
    """Largest angle, best estimate."""
    largest_upper_deg: float | None
    """Largest upper end of its 95 % interval."""
    limit_deg: float | None
    is_corrected: bool
    """The first value was an upper bound, and the limit was not reached, by the gateway's word or by all that it saw."""
    incident: str | None
    text: str
    """The line for the operator when its level became the highest."""
    acknowledged_by: str | None = None
    """Who acknowledged it last; None: nobody, as far as the recording states."""
    acknowledged_utc_ns: int | None = None


def join_alerts(segments: Iterable[tuple[str, SegmentSummary]]) -> list[RecordedAlert]:
    """Return the alerts of consecutive segments, given by boot id and summary, in order of their begin."""
    periods: AlertPeriods[AlertState] = AlertPeriods()
    last_boot_id, last_utc_ns = None, 0
    for boot_id, summary in segments:
        if last_boot_id not in (None, boot_id):
            periods.end_boot(last_utc_ns)
        for state in summary.alerts:
            periods.add(state.utc_ns, state)
        last_boot_id, last_utc_ns = boot_id, summary.to_ns + summary.wall_offset_ns
    return sorted(
        (found for period in periods.all if (found := _recorded(period)) is not None),
        key=lambda found: (found.from_utc_ns, math.inf if found.to_utc_ns is None else found.to_utc_ns),
    )


def _recorded(period: AlertPeriod[AlertState]) -> RecordedAlert | None:
    """Return an alert as a recording has it; None for one that was not raised in it."""
    first, highest, known = period.raised, period.highest, period.acknowledgement
    if first is None or first.active is None or highest is None:
        return None
    is_before = first.statement.event == "standing"
    since_utc_ns = first.active.since_ns + first.time_ns - first.statement.log_time_ns
    is_unknown = period.present is not None and period.present.level == "unknown"
    return RecordedAlert(
        rule=period.rule,
        level=highest.level,
        from_utc_ns=since_utc_ns if is_before else first.time_ns,
        to_utc_ns=period.end_ns,
        is_raised_before=is_before,
        ended=period.ended or ("unknown" if is_unknown else "standing"),
        largest_deg=period.largest_deg,
        largest_upper_deg=period.largest_upper_deg,
        limit_deg=highest.limit_deg,
        is_corrected=period.is_corrected,
        incident=period.incident,
        text=highest.text,
        acknowledged_by=None if known is None else known.statement.acknowledged_by,
        acknowledged_utc_ns=None if known is None else known.time_ns,
    )


def largest_peak(peaks: Iterable[RecordedPeak | None]) -> RecordedPeak | None:
    """Return the largest of what is known; None: nothing is."""
    return max(filter(None, peaks), key=lambda peak: peak.phi_max_deg, default=None)


def verdicts_s(segments: Iterable[SegmentSummary]) -> dict[str, float]:
    """Return the seconds of each verdict of the condition."""
    total_s: defaultdict[str, float] = defaultdict(float)
    for summary in segments:
        for verdict, seconds in summary.verdict_s.items():
            total_s[verdict] += seconds
    return dict(total_s)


def unknown_s(segments: Iterable[SegmentSummary]) -> float:
    """Return for how many seconds no statement on the swing was possible."""
    total_ns = 0
    for summary in segments:
        ends_ns = [state.log_time_ns for state in summary.alerts[1:]] + [summary.to_ns]
        for state, end_ns in zip(summary.alerts, ends_ns, strict=False):
            if any(alert.rule == "swing" and alert.level == "unknown" for alert in state.active):
                total_ns += max(end_ns - state.log_time_ns, 0)
    return total_ns / 1e9
