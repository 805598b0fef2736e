"""The comparison of `plumbline archive replay --against-version` as text and as JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from gateway.recording.format.summary_builder import RecordedAlert
from gateway.recording.reading.interval import iso_utc

if TYPE_CHECKING:
    from gateway.archive.alternatives import OutcomeChange, ReplayChange, VersionComparison

MAX_LISTED = 20
"""Starts that are printed. Basis: a choice; a screen or two, and the JSON has all."""


def changes_text(found: "VersionComparison", before: str, after: str) -> str:
    """Return the starts that differ, those first in which an operator would have noticed most."""
    return "\n".join(_lines(found, before, after))


def _lines(found: "VersionComparison", before: str, after: str) -> Iterator[str]:
    yield f"{found.compared} starts, {before} and {after}: an operator would have seen {len(found.changes)} otherwise"
    for change in found.changes[:MAX_LISTED]:
        yield f"{change.gateway} from {change.utc:%Y-%m-%d %H:%M:%S} UTC ({change.path})"
        yield from (f"    {line}" for line in _change_lines(change.change))
    if len(found.changes) > MAX_LISTED:
        yield f"and {len(found.changes) - MAX_LISTED} with less; --json has all"
    if found.not_compared:
        yield f"{found.not_compared} starts have no answer of both; run plumbline archive replay by the other version, too"


def _change_lines(change: "OutcomeChange") -> Iterator[str]:
    yield from (f"missed {_alert(alert)}" for alert in change.missed)
    yield from (f"added  {_alert(alert)}" for alert in change.added)
    yield from (f"{after.level} in place of a {_alert(before)}" for before, after in change.other_level)
    yield "largest angle " + " -> ".join("none" if each is None else f"{each:.3f} deg" for each in change.angle_deg)
    if change.unknown_s[0] != change.unknown_s[1]:
        yield "swing unknown " + " -> ".join(f"{each:.1f} s" for each in change.unknown_s)


def _alert(alert: RecordedAlert) -> str:
    largest = "" if alert.largest_deg is None else f", {alert.largest_deg:.2f} deg at most"
    return f"{alert.level} of rule {alert.rule} at {iso_utc(alert.from_utc_ns)}{largest}"


def changes_json(found: "VersionComparison") -> dict[str, Any]:
    """Return the comparison as JSON."""
    return {
        "compared": found.compared,
        "not_compared": found.not_compared,
        "changed": [_change_json(change) for change in found.changes],
    }


def _change_json(change: "ReplayChange") -> dict[str, Any]:
    content: dict[str, Any] = asdict(change)
    return {**content.pop("change"), **content, "utc": change.utc.isoformat()}
