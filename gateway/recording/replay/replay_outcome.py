"""What a run has told its operator, as recorded or as computed again: alerts, largest angles, conditions, the time without."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from gateway.recording.summary.segment_summary import RecordedPeak, SegmentSummary
from gateway.recording.summary.summary_builder import RecordedAlert, join_alerts, unknown_s

SAME_BEGIN_NS = 5_000_000_000
"""Alerts of one rule that begin within this time of each other are the same one. Basis: a choice; longer than the hold time that
a shifted start moves, shorter than two alerts of a rule."""


@dataclass(frozen=True, slots=True)
class ReplayOutcome:
    """What was told."""

    alerts: list[RecordedAlert]
    """In order of their begin; who acknowledged them is left out."""
    largest_angle: RecordedPeak | None
    largest_swing: RecordedPeak | None
    unknown_s: float
    """Time in which no statement on the swing was possible."""
    verdict_s: dict[str, float]
    """Seconds of each verdict of the condition."""


def outcome_of(summary: SegmentSummary | None) -> ReplayOutcome:
    """Return what the messages of a summary told; None: there were none."""
    if summary is None:
        return ReplayOutcome([], None, None, 0.0, {})
    alerts = [replace(each, acknowledged_by=None, acknowledged_utc_ns=None) for each in join_alerts([("", summary)])]
    return ReplayOutcome(alerts, summary.largest_angle, summary.largest_swing, unknown_s([summary]), summary.verdict_s)


def paired_alerts(
    before: Sequence[RecordedAlert], after: Sequence[RecordedAlert]
) -> Iterator[tuple[RecordedAlert | None, RecordedAlert | None]]:
    """Yield the alerts in order of their begin, each with its counterpart."""
    left = list(after)
    pairs: list[tuple[RecordedAlert | None, RecordedAlert | None]] = []
    for one in before:
        same = [
            other
            for other in left
            if other.rule == one.rule and abs(other.from_utc_ns - one.from_utc_ns) < SAME_BEGIN_NS
        ]
        pairs.append((one, same[0] if same else None))
        if same:
            left.remove(same[0])
    pairs += [(None, other) for other in left]
    yield from sorted(pairs, key=lambda pair: (pair[0] or pair[1] or before[0]).from_utc_ns)
