"""The segments of a chain that are not there, and what the gateway has stated about them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Literal

from gateway.recording.chain.statements import DeletionStatement

Place = Literal["beginning", "middle", "end"]
REMOVED = "removed"
"""The gateway states no deletion: somebody else took the segment away."""
NOT_STATED = "not_stated"
"""The segment is older than what is stated of deletions, and the gateway may have deleted it."""
DELETED = {"quota": "by the quota", "disk": "for want of space on the disk, with a quota"}
SHOWN = 8
"""Ranges that a message names; of others it has the number. Basis: a choice; one line of a terminal."""


@dataclass(frozen=True, slots=True)
class MissingSegments:
    """Neighbouring numbers without a file."""

    first: int
    last: int
    place: Place
    reason: str
    """Why the gateway has deleted them; or `REMOVED`, or `NOT_STATED`."""
    quota_mb: float | None = None
    """The quota at the time of the deletion."""


def list_missing(found: Sequence[int], first: int, last: int, stated: DeletionStatement) -> tuple[MissingSegments, ...]:
    """Return the numbers from `first` to `last` that are not found; `found` ascends and has one at least."""
    gaps: list[tuple[int, int, Place]] = [(first, found[0] - 1, "beginning")]
    gaps += [(before + 1, after - 1, "middle") for before, after in pairwise(found)]
    gaps.append((found[-1] + 1, last, "end"))
    return tuple(_explain([gap for gap in gaps if gap[0] <= gap[1]], stated))


def describe_missing(missing: Iterable[MissingSegments], stated: DeletionStatement) -> tuple[list[str], list[str]]:
    """Return sentences about those that were removed, and about those that the gateway has deleted or may have deleted."""
    problems, remarks = [], []
    ordered = sorted(missing, key=lambda each: (each.place, each.reason, each.quota_mb or 0.0))
    for (place, reason, quota_mb), group in groupby(ordered, lambda each: (each.place, each.reason, each.quota_mb)):
        which = f"{_list(list(group))} missing {'in' if place == 'middle' else 'at'} the {place}"
        if reason == REMOVED:
            problems.append(f"REMOVED: {which}; nothing signed speaks of a deletion by the gateway")
        elif reason == NOT_STATED:
            why = f"the quota had deleted segments up to {stated.unstated_up_to}, and which ones is not stated"
            remarks.append(f"{which}; nothing signed says why: {why}")
        else:
            signed = "has signed" if stated.public_key else "states without a signature"
            remarks.append(
                f"{which}: deleted {DELETED.get(reason, reason)} of {quota_mb:g} MB, as the gateway {signed}"
            )
    return problems, remarks


def _explain(gaps: Iterable[tuple[int, int, Place]], stated: DeletionStatement) -> Iterator[MissingSegments]:
    """Divide gaps by what is stated about them."""
    runs = sorted(
        (*run, deletion.reason, deletion.quota_mb) for deletion in stated.deleted for run in deletion.segments
    )
    next_run = 0
    for start, last, place in gaps:
        first = start
        while first <= last:
            while next_run < len(runs) and runs[next_run][1] < first:
                next_run += 1
            if next_run == len(runs) or runs[next_run][0] > last:
                yield from _unexplained(first, last, place, stated)
                break
            run_first, run_last, reason, quota_mb = runs[next_run]
            yield from _unexplained(first, run_first - 1, place, stated)
            end = min(run_last, last)
            yield MissingSegments(max(first, run_first), end, place, reason, quota_mb)
            first = end + 1


def _unexplained(first: int, last: int, place: Place, stated: DeletionStatement) -> Iterator[MissingSegments]:
    removed_from = max(first, stated.unstated_up_to + 1)
    if first < min(removed_from, last + 1):
        yield MissingSegments(first, min(removed_from - 1, last), place, NOT_STATED)
    if removed_from <= last:
        yield MissingSegments(removed_from, last, place, REMOVED)


def _list(missing: Sequence[MissingSegments]) -> str:
    count = sum(each.last - each.first + 1 for each in missing)
    shown = ", ".join(
        str(each.first) if each.first == each.last else f"{each.first} to {each.last}" for each in missing[:SHOWN]
    )
    more = sum(each.last - each.first + 1 for each in missing[SHOWN:])
    return f"{'segment' if count == 1 else 'segments'} {shown}{f' and {more} more' if more else ''} " + (
        "is" if count == 1 else "are"
    )
