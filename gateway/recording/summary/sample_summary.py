"""The samples of a segment in numbers: their count, rate, losses and gaps."""

from array import array
from dataclasses import dataclass, field

import numpy as np

from gateway.messages import Samples

MIN_GAP_PERIODS = 1.5
"""A longer distance between neighbouring samples, in periods, is a gap. Basis: a lost sample makes two periods, jitter less than
one and a half."""
MAX_LISTED_GAPS = 200
"""The longest gaps are listed, all are counted. Basis: a choice; more than anybody reads, and some kilobytes."""


@dataclass(frozen=True, slots=True)
class SampleGap:
    """An interval without samples, in gateway time."""

    from_ns: int
    """The last sample before."""
    to_ns: int
    """The first sample after."""
    missing: int
    """Number of samples that would have fitted in between."""

    @property
    def length_s(self) -> float:
        """Seconds from the sample before to the sample after."""
        return (self.to_ns - self.from_ns) / 1e9


@dataclass(frozen=True, slots=True)
class SampleSummary:
    """The samples of consecutive blocks; times in gateway time."""

    count: int
    first_ns: int
    last_ns: int
    period_ns: float | None
    """Median distance of neighbouring samples; None for a single sample."""
    lost: int
    """Number of samples that the device or the link is known to have lost."""
    invalid: int
    gap_count: int
    gap_s: float
    """Total length of all gaps."""
    gaps: list[SampleGap]
    """The longest gaps, in order of time."""
    missing_blocks: int
    """Number of blocks missing by their sequence numbers."""
    first_sequence: int
    last_sequence: int


@dataclass(slots=True)
class SampleCounter:
    """The blocks found so far."""

    _first_ns: "array[int]" = field(default_factory=lambda: array("q"))
    _last_ns: "array[int]" = field(default_factory=lambda: array("q"))
    _length: "array[int]" = field(default_factory=lambda: array("q"))
    _sequence: "array[int]" = field(default_factory=lambda: array("q"))
    _lost: int = 0
    _invalid: int = 0

    def add(self, samples: Samples, last_ns: int) -> None:
        """Add a block whose newest sample is at `last_ns` of gateway time."""
        self._first_ns.append(samples.first_log_time_ns)
        self._last_ns.append(last_ns)
        self._length.append(len(samples.x))
        self._sequence.append(samples.sequence)
        self._lost += samples.lost
        self._invalid += samples.invalid

    def summary(self) -> SampleSummary | None:
        """Return the numbers of all blocks; None without a block."""
        if not self._length:
            return None
        first_ns, last_ns, length = (
            np.array(one, dtype=np.int64) for one in (self._first_ns, self._last_ns, self._length)
        )
        period_ns = _period_ns(first_ns, last_ns, length)
        between_ns = first_ns[1:] - last_ns[:-1]
        late = np.flatnonzero(between_ns > MIN_GAP_PERIODS * period_ns) if period_ns else np.zeros(0, dtype=np.intp)
        longest = np.sort(late[np.argsort(between_ns[late])[-MAX_LISTED_GAPS:]])
        return SampleSummary(
            count=int(length.sum()),
            first_ns=int(first_ns[0]),
            last_ns=int(last_ns[-1]),
            period_ns=period_ns,
            lost=self._lost,
            invalid=self._invalid,
            gap_count=len(late),
            gap_s=float(between_ns[late].sum()) / 1e9,
            gaps=[gap_between(int(last_ns[i]), int(first_ns[i + 1]), period_ns) for i in longest],
            missing_blocks=int((np.diff(self._sequence) - 1).clip(min=0).sum()),
            first_sequence=self._sequence[0],
            last_sequence=self._sequence[-1],
        )


def gap_between(before_ns: int, after_ns: int, period_ns: float | None) -> SampleGap:
    """Return the gap between two samples, of which the number of missing ones is known with the period."""
    missing = round((after_ns - before_ns) / period_ns) - 1 if period_ns else 0
    return SampleGap(before_ns, after_ns, max(missing, 0))


def is_gap(before_ns: int, after_ns: int, period_ns: float | None) -> bool:
    """Return whether a sample is missing between two neighbours."""
    return period_ns is not None and after_ns - before_ns > MIN_GAP_PERIODS * period_ns


def _period_ns(
    first_ns: np.ndarray[tuple[int], np.dtype[np.int64]],
    last_ns: np.ndarray[tuple[int], np.dtype[np.int64]],
    length: np.ndarray[tuple[int], np.dtype[np.int64]],
) -> float | None:
    """Return the median distance of neighbouring samples, inside blocks and between them."""
    inside = length > 1
    periods_ns = np.concatenate([(last_ns - first_ns)[inside] / (length[inside] - 1), first_ns[1:] - last_ns[:-1]])
    return float(np.median(periods_ns)) if len(periods_ns) else None
