"""The samples of a timeline, and the gaps in it: inside segments and between them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from gateway.recording.chain.statements import DELETED, DeletionStatement, join_stated, list_missing
from gateway.recording.format.content import CUT, ORIGIN, TRIMMED, segment_number
from gateway.recording.format.segment_summary import SampleSummary, SegmentSummary, gap_between, is_gap
from gateway.recording.reading.recording_file import SegmentIndex, is_altered

SummarisedSegment = tuple[SegmentIndex, SegmentSummary]
NOT_ARRIVED, RESTARTED, NOT_GIVEN = "no samples arrived", "gateway restarted", "not in these files"
TRIMMED_BEFORE = "not in these files, which the quota had trimmed"
LONGEST_SILENCE_NS = 2_000_000_000
"""Time of a file without samples at its end from which on a damaged one is asked why. Basis: the gateway tells its health once a
second."""
MISSING_INSIDE = "missing inside its file, which is damaged, or dropped while recording"
STARTED = "the gateway was started"
RECORDED = frozenset({NOT_ARRIVED, RESTARTED, STARTED})
"""Causes of which nothing is missing that was recorded."""


@dataclass(frozen=True, slots=True)
class AbsenceCauses:
    """Says why samples are missing, by the numbers of their blocks and by what the gateway has stated of its deletions.

    What is stated is believed here; `record verify` checks who has signed it.
    """

    stated: DeletionStatement = field(default_factory=lambda: DeletionStatement(gateway=""))

    @classmethod
    def of(cls, segments: Sequence[SegmentIndex]) -> "AbsenceCauses":
        """Take all statements of segments."""
        return cls(join_stated(segments))

    def between(self, before: SegmentIndex, after: SegmentIndex, missing_blocks: int) -> str:
        """Return why there is a gap between samples of one run of the gateway, which are of two segments, or of one."""
        if not missing_blocks:
            return NOT_ARRIVED
        if before.path == after.path and not {CUT, TRIMMED} & before.metadata.keys():
            return MISSING_INSIDE
        return self._absence({*before.metadata, *after.metadata}, _number(before) + 1, _number(after))

    def between_runs(self, before: SegmentIndex, after: SegmentIndex, unread_ns: int) -> str:
        """Return why there is a gap between samples of two runs; `unread_ns`: time of the first one's file behind its last."""
        numbers = _number(before), _number(after)
        if 0 not in numbers and numbers[1] - numbers[0] > 1:
            return self._absence({*before.metadata, *after.metadata}, numbers[0] + 1, numbers[1])
        return MISSING_INSIDE if unread_ns > LONGEST_SILENCE_NS and is_altered(before) else RESTARTED

    def before(self, first: SegmentIndex, first_sequence: int) -> str:
        """Return why there is nothing before the first sample of all, whose block has this number in its run."""
        if first_sequence == 0:
            return STARTED
        return self._absence(set(first.metadata), max(_number(first) - 1, 1), _number(first))

    def _absence(self, records: set[str], first: int, following: int) -> str:
        """Return the cause where the segments from `first` until before `following`, or parts of neighbours, are missing."""
        is_trimmed = TRIMMED in records
        if CUT in records or not following:
            return TRIMMED_BEFORE if is_trimmed else NOT_GIVEN
        missing = list_missing([following], min(first, following), following, self.stated)
        reasons = list(dict.fromkeys(each.reason for each in missing)) or (["quota"] if is_trimmed else [])
        if not reasons or not set(reasons) <= DELETED.keys():
            return NOT_GIVEN
        return f"deleted {' and '.join(DELETED[reason].removesuffix(', with a quota') for reason in reasons)}"


def _number(segment: SegmentIndex) -> int:
    return segment_number(segment.metadata.get(ORIGIN, {}))


@dataclass(frozen=True, slots=True)
class RecordingGap:
    """An interval without samples."""

    from_utc_ns: int
    to_utc_ns: int
    missing: int
    """Number of samples that would have fitted in between."""
    cause: str
    """no samples arrived, gateway restarted, deleted by the quota, not in these files, ..."""

    @property
    def length_s(self) -> float:
        """Seconds from the sample before to the sample after."""
        return (self.to_utc_ns - self.from_utc_ns) / 1e9


@dataclass(frozen=True, slots=True)
class SampleInfo:
    """The samples of all segments."""

    count: int
    rate_hz: float | None
    lost: int
    """Number of samples that the device or the link is known to have lost."""
    invalid: int
    gaps: int
    gap_s: float
    """Total length of all gaps."""
    longest_gap_s: float | None
    missing_blocks: int
    """Number of blocks missing by their sequence numbers."""


@dataclass(frozen=True, slots=True)
class _Part:
    """The samples of one segment."""

    segment: SegmentIndex
    samples: SampleSummary
    wall_offset_ns: int


def join_samples(segments: Sequence[SummarisedSegment]) -> tuple[SampleInfo, list[RecordingGap]]:
    """Return the numbers of the samples of consecutive segments, and the gaps in order of time."""
    parts = _parts(segments)
    causes = AbsenceCauses.of([segment for segment, _ in segments])
    inside = [
        RecordingGap(
            gap.from_ns + part.wall_offset_ns,
            gap.to_ns + part.wall_offset_ns,
            gap.missing,
            causes.between(part.segment, part.segment, part.samples.missing_blocks),
        )
        for part in parts
        for gap in part.samples.gaps
    ]
    between = _gaps_between(parts, causes)
    gaps = sorted([*inside, *between], key=lambda gap: gap.from_utc_ns)
    periods_ns = [part.samples.period_ns for part in parts if part.samples.period_ns]
    info = SampleInfo(
        count=sum(part.samples.count for part in parts),
        rate_hz=1e9 * len(periods_ns) / sum(periods_ns) if periods_ns else None,
        lost=sum(part.samples.lost for part in parts),
        invalid=sum(part.samples.invalid for part in parts),
        gaps=len(between) + sum(part.samples.gap_count for part in parts),
        gap_s=sum(gap.length_s for gap in between) + sum(part.samples.gap_s for part in parts),
        longest_gap_s=max((gap.length_s for gap in gaps), default=None),
        missing_blocks=sum(part.samples.missing_blocks for part in parts)
        + sum(_missing_blocks(before, after) for before, after in pairwise(parts)),
    )
    return info, gaps


def describe_overlaps(segments: Sequence[SummarisedSegment]) -> list[str]:
    """Return a remark on each segment whose samples begin before the end of those before it: they are counted twice."""
    remarks = []
    for before, after in pairwise(_parts(segments)):
        overlap_ns = before.samples.last_ns + before.wall_offset_ns - after.samples.first_ns - after.wall_offset_ns
        if overlap_ns >= 0:
            names = f"{after.segment.path.name}: overlaps {before.segment.path.name} by {overlap_ns / 1e9:.3f} s"
            remarks.append(f"{names}; its samples are counted twice, or the clock was set back between two starts")
    return remarks


def _parts(segments: Sequence[SummarisedSegment]) -> list[_Part]:
    return [_Part(each, summary.samples, summary.wall_offset_ns) for each, summary in segments if summary.samples]


def _gaps_between(parts: Sequence[_Part], causes: AbsenceCauses) -> list[RecordingGap]:
    """Return the gaps between neighbouring segments; in UTC, because a restart begins another gateway time."""
    gaps = []
    for before, after in pairwise(parts):
        is_same_run = before.segment.boot_id == after.segment.boot_id
        offset_ns = after.wall_offset_ns if is_same_run else before.wall_offset_ns
        ends_ns = before.samples.last_ns + offset_ns
        begins_ns = after.samples.first_ns + after.wall_offset_ns
        if is_gap(ends_ns, begins_ns, before.samples.period_ns):
            missing = gap_between(ends_ns, begins_ns, before.samples.period_ns).missing
            gaps.append(RecordingGap(ends_ns, begins_ns, missing, _cause(before, after, causes)))
    return gaps


def _cause(before: _Part, after: _Part, causes: AbsenceCauses) -> str:
    if before.segment.boot_id != after.segment.boot_id:
        unread_ns = before.segment.to_ns - before.samples.last_ns
        return causes.between_runs(before.segment, after.segment, unread_ns)
    return causes.between(before.segment, after.segment, _missing_blocks(before, after))


def _missing_blocks(before: _Part, after: _Part) -> int:
    """Return the number of blocks that are missing between two segments of one run of the gateway."""
    if before.segment.boot_id != after.segment.boot_id:
        return 0
    return max(after.samples.first_sequence - before.samples.last_sequence - 1, 0)
