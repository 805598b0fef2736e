"""The alerts of a timeline, each from raised to cleared, also where it begins in one segment and ends in another."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

from gateway.messages import ActiveAlert
from gateway.recording.segment_summary import AlertState, SegmentSummary

RAISED = ("warn", "trip")
EndReason = Literal["cleared", "unknown", "gateway ended", "not recorded", "standing"]


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
    ended: EndReason
    """unknown: the angle was no longer known; not recorded: it cleared in a gap; standing: the recording ends before it."""
    largest_deg: float | None
    """Largest angle, best estimate."""
    largest_upper_deg: float | None
    """Largest upper end of its 95 % interval."""
    limit_deg: float | None
    is_corrected: bool
    """The first value was an upper bound, and the limit was not reached."""
    incident: str | None
    text: str
    """The line for the operator when its level became the highest."""
    acknowledged_by: str | None = None
    """Who acknowledged it last; None: nobody, as far as the recording states."""
    acknowledged_utc_ns: int | None = None


@dataclass(slots=True)
class _Tracker:
    """The alerts that are open."""

    open: dict[str, RecordedAlert] = field(default_factory=dict)
    is_first: bool = True
    boot_id: str | None = None

    def begin_segment(self, boot_id: str, utc_ns: int) -> Iterator[RecordedAlert]:
        """Begin a segment; a restart of the gateway ends all open alerts."""
        if self.boot_id not in (None, boot_id):
            yield from self._end_all("gateway ended", utc_ns)
        self.boot_id, self.is_first = boot_id, True

    def add(self, state: AlertState) -> Iterator[RecordedAlert]:
        """Take the state after a change, or the first one of a segment; yield the alerts that have ended."""
        raised = {alert.rule: alert for alert in state.active if alert.level in RAISED}
        unknown = {alert.rule: alert for alert in state.active if alert.level == "unknown"}
        for rule, period in list(self.open.items()):
            if rule in raised and _is_same(period, raised[rule]):
                continue
            if rule in unknown and period.incident is not None and unknown[rule].incident == period.incident:
                continue  # suspended during a recalibration
            ended: EndReason = "cleared" if state.rule == rule else "unknown" if rule in unknown else "not recorded"
            if rule in raised:
                ended = "not recorded"
            yield self._end(rule, ended, state)
        for rule, alert in raised.items():
            self._begin_or_raise(rule, alert, state)
        self.is_first = False

    def finish(self) -> Iterator[RecordedAlert]:
        """Yield the alerts that are still open."""
        yield from self._end_all("standing", None)

    def _begin_or_raise(self, rule: str, alert: ActiveAlert, state: AlertState) -> None:
        period = self.open.get(rule)
        if period is None:
            since_utc_ns = alert.since_ns + state.utc_ns - state.log_time_ns
            is_before = self.is_first and state.event == "standing"
            period = RecordedAlert(
                rule=rule,
                level=alert.level,
                from_utc_ns=since_utc_ns if is_before else state.utc_ns,
                to_utc_ns=None,
                is_raised_before=is_before,
                ended="standing",
                largest_deg=None,
                largest_upper_deg=None,
                limit_deg=alert.limit_deg,
                is_corrected=False,
                incident=alert.incident,
                text=alert.text,
            )
        elif alert.level == "trip" and period.level == "warn":
            period = replace(period, level="trip", limit_deg=alert.limit_deg, text=alert.text)
        self.open[rule] = replace(
            period,
            largest_deg=_largest(period.largest_deg, alert.largest_deg),
            largest_upper_deg=_largest(period.largest_upper_deg, alert.largest_upper_deg),
            is_corrected=period.is_corrected or (state.event == "corrected" and state.rule == rule),
        )

    def _end(self, rule: str, ended: EndReason, state: AlertState) -> RecordedAlert:
        period = self.open.pop(rule)
        if ended == "cleared":
            period = replace(
                period,
                largest_deg=_largest(period.largest_deg, state.largest_deg),
                largest_upper_deg=_largest(period.largest_upper_deg, state.largest_upper_deg),
            )
        return replace(period, ended=ended, to_utc_ns=state.utc_ns)

    def _end_all(self, ended: EndReason, utc_ns: int | None) -> Iterator[RecordedAlert]:
        for period in self.open.values():
            yield replace(period, ended=ended, to_utc_ns=utc_ns)
        self.open = {}


def join_alerts(segments: Iterable[tuple[str, SegmentSummary]]) -> list[RecordedAlert]:
    """Return the alerts of consecutive segments, given by boot id and summary, in order of their begin."""
    tracker = _Tracker()
    periods: list[RecordedAlert] = []
    acknowledged: dict[str | None, AlertState] = {}
    last_utc_ns = 0
    for boot_id, summary in segments:
        periods += tracker.begin_segment(boot_id, last_utc_ns)
        for state in summary.alerts:
            periods += tracker.add(state)
            if state.event == "acknowledged":
                acknowledged[state.incident] = state
        last_utc_ns = summary.to_ns + summary.wall_offset_ns
    periods += tracker.finish()
    periods = [_with_acknowledgement(period, acknowledged.get(period.incident)) for period in periods]
    return sorted(periods, key=lambda period: period.from_utc_ns)


def _with_acknowledgement(period: RecordedAlert, state: AlertState | None) -> RecordedAlert:
    """Return an alert with its acknowledgement, which may come after its end."""
    if state is None:
        return period
    return replace(period, acknowledged_by=state.acknowledged_by, acknowledged_utc_ns=state.utc_ns)


def unknown_s(segments: Iterable[SegmentSummary], rule: str = "swing") -> float:
    """Return for how many seconds no statement on a rule was possible."""
    total_ns = 0
    for summary in segments:
        ends_ns = [state.log_time_ns for state in summary.alerts[1:]] + [summary.to_ns]
        for state, end_ns in zip(summary.alerts, ends_ns, strict=False):
            if any(alert.rule == rule and alert.level == "unknown" for alert in state.active):
                total_ns += max(end_ns - state.log_time_ns, 0)
    return total_ns / 1e9


def _is_same(period: RecordedAlert, alert: ActiveAlert) -> bool:
    """Return whether an active alert is that of an open period."""
    return None in (period.incident, alert.incident) or period.incident == alert.incident


def _largest(first: float | None, second: float | None) -> float | None:
    known = [value for value in (first, second) if value is not None]
    return max(known, default=None)
