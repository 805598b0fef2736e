"""The times of an incident without samples, each with its cause: nothing came, or what was recorded is not there any more."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gateway.numerics.array import Array
from gateway.recording.export.gaps import NOT_ARRIVED, RECORDED, AbsenceCauses
from gateway.recording.format.segment_summary import MIN_GAP_PERIODS
from gateway.recording.reading.recording_file import SegmentIndex

RECORDINGS_END = "the recordings end"


@dataclass(frozen=True, slots=True)
class TimeGap:
    """A time without samples."""

    begin_s: float
    end_s: float
    cause: str

    @property
    def is_hole(self) -> bool:
        """What was recorded in it, or may have been, is not in the recordings."""
        return self.cause not in RECORDED

    def within_s(self, begin_s: float, end_s: float) -> float:
        """Return how much of it is between two times."""
        return max(0.0, min(self.end_s, end_s) - max(self.begin_s, begin_s))


@dataclass(frozen=True, slots=True)
class BlockPlace:
    """A block of samples, and where it stands in the recordings."""

    time_s: Array
    """Times of its samples, shape (n,)."""
    segment: SegmentIndex
    boot_id: str
    sequence: int
    """Number in the run of the gateway."""
    unread_ns: int
    """Time of its file behind it."""


def find_gaps(
    blocks: Sequence[BlockPlace],
    before: BlockPlace | None,
    after: BlockPlace | None,
    span_s: tuple[float, float],
    period_s: float,
    causes: AbsenceCauses,
) -> tuple[TimeGap, ...]:
    """Return the gaps between two times, `span_s`, of blocks in order of time.

    `before` and `after`: the blocks next to them in the recordings; None: there is none.
    """
    if period_s <= 0:
        return ()
    gaps = [TimeGap(*times_s, NOT_ARRIVED) for block in blocks for times_s in _late_samples(block, period_s)]
    known = [*filter(None, [before, *blocks, after])]
    gaps += [
        TimeGap(float(earlier.time_s[-1]), float(later.time_s[0]), _cause(earlier, later, causes))
        for earlier, later in pairwise(known)
    ]
    if before is None:
        gaps.append(
            TimeGap(span_s[0], float(blocks[0].time_s[0]), causes.before(blocks[0].segment, blocks[0].sequence))
        )
    if after is None:
        gaps.append(TimeGap(float(blocks[-1].time_s[-1]), span_s[1], RECORDINGS_END))
    inside = (TimeGap(max(gap.begin_s, span_s[0]), min(gap.end_s, span_s[1]), gap.cause) for gap in gaps)
    longer = (gap for gap in inside if gap.end_s - gap.begin_s > MIN_GAP_PERIODS * period_s)
    return tuple(sorted(longer, key=lambda gap: gap.begin_s))


def broken_at(gaps: Sequence[TimeGap], time_s: Array, *values: Array) -> tuple[Array, ...]:
    """Return times (n,) and values (n, ...) with a NaN in each gap, so that no line is drawn over it."""
    places = np.searchsorted(time_s, [gap.end_s for gap in gaps])
    times_s = np.insert(time_s, places, [gap.end_s for gap in gaps])
    return times_s, *(np.insert(each, places, np.nan, axis=0) for each in values)


def _late_samples(block: BlockPlace, period_s: float) -> list[tuple[float, float]]:
    late = np.flatnonzero(np.diff(block.time_s) > MIN_GAP_PERIODS * period_s)
    return [(float(block.time_s[index]), float(block.time_s[index + 1])) for index in late]


def _cause(earlier: BlockPlace, later: BlockPlace, causes: AbsenceCauses) -> str:
    if earlier.boot_id != later.boot_id:
        return causes.between_runs(earlier.segment, later.segment, earlier.unread_ns)
    return causes.between(earlier.segment, later.segment, later.sequence - earlier.sequence - 1)
