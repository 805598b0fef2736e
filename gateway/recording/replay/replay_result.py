"""The result of a replay: what the run has told its operator, as recorded and as computed again, as text and as JSON."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from gateway import messages
from gateway.recording.format.segment_summary import RecordedPeak, SegmentSummary
from gateway.recording.format.summary_builder import RecordedAlert, join_alerts, largest_peak, unknown_s, verdicts_s
from gateway.recording.reading.interval import zoned
from gateway.recording.replay.replay_run import ReplayResult

SAME_BEGIN_NS = 5_000_000_000
"""Alerts of one rule that begin within this time of each other are the same one. Basis: a choice; longer than the hold time that
a shifted start moves, shorter than two alerts of a rule."""

COLD_START = "? may come from the start alone: what the gateway had learnt before is not in these recordings"


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


def outcome_of(runs: Sequence[tuple[str, SegmentSummary]]) -> ReplayOutcome:
    """Return what runs told, given by boot id and summary in order of time."""
    alerts = [replace(each, acknowledged_by=None, acknowledged_utc_ns=None) for each in join_alerts(runs)]
    told = [summary for _, summary in runs]
    angle = largest_peak(summary.largest_angle for summary in told)
    swing = largest_peak(summary.largest_swing for summary in told)
    return ReplayOutcome(alerts, angle, swing, unknown_s(told), verdicts_s(told))


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


@dataclass(frozen=True, slots=True)
class ReplayRow:
    """One line of the table of differences."""

    quantity: str
    recorded: str
    recomputed: str

    @property
    def differs(self) -> bool:
        """The two values are not the same."""
        return self.recorded != self.recomputed


def replay_rows(result: ReplayResult, *, is_local: bool = False) -> list[ReplayRow]:
    """Return alerts, peaks and conditions as recorded and as computed again."""
    return list(_rows(outcome_of(result.recorded), outcome_of(result.recomputed), is_local))


def has_difference(result: ReplayResult) -> bool:
    """Return whether anything differs: a message, or with other settings a line of the table."""
    if result.mode == "same":
        return bool(result.comparison.differing)
    return any(row.differs for row in replay_rows(result))


def replay_text(result: ReplayResult, *, is_local: bool = False) -> str:
    """Return the output of `plumbline record replay`."""
    return "\n".join(_lines(result, is_local))


def replay_json(result: ReplayResult) -> dict[str, Any]:
    """Return the content of `record replay --json`."""
    comparison = result.comparison
    first = comparison.first
    return {
        "schema_version": messages.SCHEMA_VERSION,
        "mode": result.mode,
        "equal": result.is_compared and not has_difference(result),
        "is_compared": result.is_compared,
        "is_from_start": result.is_from_start,
        "notes": result.notes,
        "hidden": result.hidden,
        "altered": result.altered,
        "compared": dict(comparison.compared),
        "differing": dict(comparison.differing),
        "cut_off": dict(comparison.cut_off),
        "not_compared": dict(comparison.not_compared),
        "first_difference": None if first is None else {**asdict(first), **_as_texts(first.recorded, first.recomputed)},
        "table": [{**asdict(row), "differs": row.differs} for row in replay_rows(result)],
        "recorded": asdict(outcome_of(result.recorded)),
        "recomputed": asdict(outcome_of(result.recomputed)),
    }


def _as_texts(recorded: Any, recomputed: Any) -> dict[str, Any]:
    values = {"recorded": recorded, "recomputed": recomputed}
    return {
        name: value.decode(errors="replace") if isinstance(value, bytes) else value for name, value in values.items()
    }


def _lines(result: ReplayResult, is_local: bool) -> Iterator[str]:
    yield from result.notes
    yield from (f"not replayed: {each}" for each in result.hidden)
    yield from (f"{each}; every message in it could be read" for each in result.altered)
    comparison = result.comparison
    if not result.is_compared:
        return
    if result.mode == "same":
        total, differing = sum(comparison.compared.values()), sum(comparison.differing.values())
        topics = ", ".join(f"{topic} {count}" for topic, count in sorted(comparison.compared.items()))
        shares = comparison.compared_within
        how = "; ".join(f"{count} {name}" if len(shares) > 1 else name for name, count in shares.items())
        yield f"{total} messages computed again, {differing} differ ({how})"
        yield f"  {topics}"
        if not_compared := comparison.not_compared.total():
            yield f"{not_compared} were not compared: they are in or beside what was not replayed, or depend on it"
        if cut_off := comparison.cut_off.total():
            yield f"{cut_off} at the end of the last file, or of one that was cut off, are not recorded, which is no difference"
    if comparison.first is not None:
        first = comparison.first
        yield f"first difference: {first.topic} at {_time(first.utc_ns, is_local)}, field {first.field or 'encoding'}"
        yield f"  recorded    {_short(first.recorded)}"
        yield f"  recomputed  {_short(first.recomputed)}"
        yield "  differing: " + ", ".join(f"{topic} {count}" for topic, count in sorted(comparison.differing.items()))
    if result.mode == "other" or comparison.first is not None or not result.is_from_start:
        yield ""
        if not result.is_from_start:
            yield COLD_START
        mark = "*" if result.is_from_start else "?"
        yield f"  {'':<16}{'recorded':<58}recomputed"
        for row in replay_rows(result, is_local=is_local):
            yield f"{mark if row.differs else ' '} {row.quantity:<16}{row.recorded:<58}{row.recomputed}"


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 200 else f"{text[:200]}..."


def _rows(recorded: ReplayOutcome, recomputed: ReplayOutcome, is_local: bool) -> Iterator[ReplayRow]:
    for one, other in paired_alerts(recorded.alerts, recomputed.alerts):
        known = one or other
        name = f"{known.rule} alert" if known is not None else ""
        yield ReplayRow(name, _alert_text(one, is_local), _alert_text(other, is_local))
    both = (recorded, recomputed)
    yield ReplayRow("swing unknown", *(f"{each.unknown_s:.1f} s" for each in both))
    yield ReplayRow("largest angle", *(_peak_text(each.largest_angle, is_local) for each in both))
    yield ReplayRow("largest swing", *(_peak_text(each.largest_swing, is_local) for each in both))
    for verdict in sorted({*recorded.verdict_s, *recomputed.verdict_s}):
        yield ReplayRow(verdict, *(f"{each.verdict_s.get(verdict, 0.0):.1f} s" for each in both))


def _alert_text(alert: RecordedAlert | None, is_local: bool) -> str:
    if alert is None:
        return "none"
    end = "standing" if alert.to_utc_ns is None else f"{(alert.to_utc_ns - alert.from_utc_ns) / 1e9:.1f} s"
    upper = "" if alert.largest_upper_deg is None else f", up to {alert.largest_upper_deg:.2f} deg"
    return f"{alert.level} at {_time(alert.from_utc_ns, is_local)}, {end}{upper}"


def _peak_text(peak: RecordedPeak | None, is_local: bool) -> str:
    if peak is None:
        return "none"
    u = "" if peak.u_deg is None else f" (u {peak.u_deg:.2g})"
    return f"{peak.phi_max_deg:.3f} deg{u} at {_time(peak.time_ns, is_local)}"


def _time(utc_ns: int, is_local: bool) -> str:
    return zoned(utc_ns, is_local=is_local).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]
