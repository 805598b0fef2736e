"""What a gateway states, in JSON and signed with its key, about a segment, and about the segments that it has deleted.

A checkpoint in a segment that is being written states the bytes so far; the final statement of a compacted segment states all of
it. Both are metadata records named `signature`. The newest statement of deletions stands in `chain.json`, and in each segment in
a metadata record named `deletions`; by it the segments that are not there are explained.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import reduce
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Literal

from gateway.file_input import decode_json
from gateway.pki.signing_key import is_valid
from gateway.recording.chain.chain_state import ChainState, SegmentNumber, is_signed

if TYPE_CHECKING:
    from gateway.recording.reading.recording_file import SegmentIndex

SIGNATURE = "signature"
SIGNS_STATE = 2
"""Format of the statements of a gateway that signs `chain.json` too."""
StatementKind = Literal["checkpoint", "final"]
DELETIONS = "deletions"
DeletionReason = Literal["quota", "disk"]
"""All recordings were larger than the quota; the disk had less room than the quota."""
Run = tuple[SegmentNumber, SegmentNumber]
"""First and last number of neighbouring segments."""
MAX_RUNS = 1000
"""Most runs in a statement. Basis: 12 kB in each segment; with eight events a day apart from each other, four months."""
Place = Literal["beginning", "middle", "end"]
REMOVED = "removed"
"""The gateway states no deletion: somebody else took the segment away."""
NOT_STATED = "not_stated"
"""The segment is older than what is stated of deletions, and the gateway may have deleted it."""
NOT_GIVEN = "not_given"
"""The files are an extract, and nothing proves that the segment should be among them."""
DELETED = {"quota": "by the quota", "disk": "for want of space on the disk, with a quota"}
SHOWN = 8
"""Ranges that a message names; of others it has the number. Basis: a choice; one line of a terminal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """What the gateway states about a segment up to the signature; times are gateway times."""

    format: int = SIGNS_STATE
    kind: StatementKind
    gateway: str
    name: str
    """The file's name."""
    segment: SegmentNumber
    """Number of the segment, from 1 on."""
    previous_segment: SegmentNumber
    """Number of the last segment with a final statement; 0: none."""
    previous_sha256: str
    """Hash of that statement."""
    deleted_up_to: SegmentNumber
    """Largest number of a segment that the quota has deleted; which ones, a statement of their own says, see `deletions`."""
    bytes: int
    """Length of the file before the signature."""
    sha256: str
    """Hash of these bytes."""
    from_ns: int
    to_ns: int
    """Gateway times of the first and the last message."""
    repaired: bool = False
    """The segment had ended in a kill or a power failure."""
    repaired_from_ns: int = 0
    """Gateway time of its last signature before that: what is later was signed with the repair alone. 0: not repaired."""
    replaces_sha256: str = ""
    """Hash of the statement about the whole segment, where this file has the time around its events only."""
    rebuilt_before: SegmentNumber = 0
    """Number of the first segment after the gateway had lost what it remembers of its chain, and had taken it from its
    recordings: what these do not tell is not stated. 0: never."""
    public_key: str = ""
    """Empty: not signed."""

    def text(self) -> str:
        """Return the bytes that are signed, as text."""
        return json.dumps(asdict(self), separators=(",", ":"))


def parse_statement(text: str) -> Statement | None:
    """Return the statement of a signature; None where it is none."""
    try:
        return decode_json(text, Statement)
    except ValueError:
        return None


def hash_of(text: str) -> str:
    """Return the hash of a statement, for the next one."""
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Deletion:
    """Segments that were deleted for one reason."""

    reason: str
    """A `DeletionReason`, or one of a later version."""
    quota_mb: float
    """`recorder.quota_mb` at the time, so that the deletions of a changed quota stand apart."""
    segments: tuple[Run, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeletionStatement:
    """All segments that a gateway has deleted, and why."""

    format: int = 1
    kind: Literal["deletions"] = "deletions"
    gateway: str
    unstated_up_to: SegmentNumber = 0
    """The gateway has deleted segments up to this number of which the statement does not tell: before it made such statements,
    or more than `MAX_RUNS` runs ago. 0: none."""
    deleted: tuple[Deletion, ...] = ()
    public_key: str = ""
    """Empty: not signed."""

    def including(self, other: "DeletionStatement") -> "DeletionStatement":
        """Return the statement with the deletions of another one."""
        runs: dict[tuple[str, float], tuple[Run, ...]] = {}
        for deletion in (*self.deleted, *other.deleted):
            why = deletion.reason, deletion.quota_mb
            runs[why] = _merge((*runs.get(why, ()), *deletion.segments))
        deleted = tuple(Deletion(*why, segments) for why, segments in runs.items())
        return replace(self, deleted=deleted, unstated_up_to=max(self.unstated_up_to, other.unstated_up_to))

    def bounded(self) -> "DeletionStatement":
        """Return the statement with the newest `MAX_RUNS` runs."""
        ends = sorted(last for deletion in self.deleted for _, last in deletion.segments)
        if len(ends) <= MAX_RUNS:
            return self
        forgotten = ends[-MAX_RUNS - 1]
        kept = (
            replace(each, segments=tuple(run for run in each.segments if run[1] > forgotten)) for each in self.deleted
        )
        deleted = tuple(each for each in kept if each.segments)
        return replace(self, deleted=deleted, unstated_up_to=max(forgotten, self.unstated_up_to))

    def text(self) -> str:
        """Return the bytes that are signed, as text."""
        return json.dumps(asdict(self), separators=(",", ":"))


def parse_deletions(record: Mapping[str, str]) -> DeletionStatement | None:
    """Return the statement of a metadata record; None where it is none. Its signature is not checked."""
    try:
        return decode_json(record.get("statement", ""), DeletionStatement)
    except ValueError:
        return None


def has_signature(record: Mapping[str, str], statement: Statement | DeletionStatement, key: str) -> bool:
    """Return whether the statement of a metadata record is signed with a key; empty: whether it says that it is not signed.

    Raises `KeyFileError` where signatures cannot be checked.
    """
    if statement.public_key != key:
        return False
    return not key or is_valid(key, record["statement"], record.get("signature", ""))


def is_forged(state: ChainState, statements: Iterable[Statement], key: str) -> bool:
    """Return whether somebody else has written the state of a gateway with this key, by its own statements.

    A version that did not sign the state may have left it unsigned. Raises `KeyFileError` where signatures cannot be checked.
    """
    signs_state = any(each.public_key == key and each.format >= SIGNS_STATE for each in statements)
    return bool(key) and (bool(state.signature) or signs_state) and not is_signed(state, key)


def _merge(runs: Iterable[Run]) -> tuple[Run, ...]:
    merged: list[Run] = []
    for first, last in sorted(runs):
        if merged and first <= merged[-1][1] + 1:
            merged[-1] = merged[-1][0], max(last, merged[-1][1])
        else:
            merged.append((first, last))
    return tuple(merged)


@dataclass(frozen=True, slots=True)
class MissingSegments:
    """Neighbouring numbers without a file."""

    first: int
    last: int
    place: Place
    reason: str
    """Why the gateway has deleted them; or `REMOVED`, `NOT_STATED`, or `NOT_GIVEN`."""
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
        which = f"{name_missing(list(group))} missing {'in' if place == 'middle' else 'at'} the {place}"
        if reason == REMOVED:
            problems.append(f"REMOVED: {which}; nothing signed speaks of a deletion by the gateway")
        elif reason == NOT_STATED:
            why = f"the quota had deleted segments up to {stated.unstated_up_to}, and which ones is not stated"
            remarks.append(f"{which}; nothing signed says why: {why}")
        elif reason != NOT_GIVEN:
            signed = "has signed" if stated.public_key else "states without a signature"
            remarks.append(
                f"{which}: deleted {DELETED.get(reason, reason)} of {quota_mb:g} MB, as the gateway {signed}"
            )
    return problems, remarks


def join_stated(segments: "Sequence[SegmentIndex]") -> DeletionStatement:
    """Return what segments state of deletions, each of its own; who has signed it is not checked."""
    records = {each.metadata.get(DELETIONS, {}).get("statement", ""): each.metadata for each in segments}
    found = (parse_deletions(metadata.get(DELETIONS, {})) for metadata in records.values())
    return reduce(DeletionStatement.including, filter(None, found), DeletionStatement(gateway=""))


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


def name_missing(missing: Sequence[MissingSegments]) -> str:
    """Return the numbers of segments, with the verb that belongs to them."""
    count = sum(each.last - each.first + 1 for each in missing)
    shown = ", ".join(
        str(each.first) if each.first == each.last else f"{each.first} to {each.last}" for each in missing[:SHOWN]
    )
    more = sum(each.last - each.first + 1 for each in missing[SHOWN:])
    return f"{'segment' if count == 1 else 'segments'} {shown}{f' and {more} more' if more else ''} " + (
        "is" if count == 1 else "are"
    )
