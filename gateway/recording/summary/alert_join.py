"""The alerts of a timeline, each from raised to cleared, also where it begins in one segment and ends in another."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from gateway.alert_periods import AlertPeriod, AlertPeriods, AlertState, EndReason
from gateway.recording.summary.segment_summary import SegmentSummary


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
    """The first value was an upper bound, and the limit was not reached."""
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
    return RecordedAlert(
        rule=period.rule,
        level=highest.level,
        from_utc_ns=since_utc_ns if is_before else first.time_ns,
        to_utc_ns=period.end_ns,
        is_raised_before=is_before,
        ended=period.ended or "standing",
        largest_deg=period.largest_deg,
        largest_upper_deg=period.largest_upper_deg,
        limit_deg=highest.limit_deg,
        is_corrected=any(step.statement.event == "corrected" for step in period.steps),
        incident=period.incident,
        text=highest.text,
        acknowledged_by=None if known is None else known.statement.acknowledged_by,
        acknowledged_utc_ns=None if known is None else known.time_ns,
    )


def unknown_s(segments: Iterable[SegmentSummary], rule: str = "swing") -> float:
    """Return for how many seconds no statement on a rule was possible."""
    total_ns = 0
    for summary in segments:
        ends_ns = [state.log_time_ns for state in summary.alerts[1:]] + [summary.to_ns]
        for state, end_ns in zip(summary.alerts, ends_ns, strict=False):
            if any(alert.rule == rule and alert.level == "unknown" for alert in state.active):
                total_ns += max(end_ns - state.log_time_ns, 0)
    return total_ns / 1e9
