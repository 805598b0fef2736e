"""The summary of a segment: everything that `record info` states, without its samples and results.

The recorder adds it to each segment that it closes, as the attachment `summary.json`, so that a day of recordings is listed in
seconds. For a segment without one it is made by reading the segment. Of the samples it has their count, rate, losses and gaps.
"""

from array import array
from dataclasses import dataclass, field

import msgspec
import numpy as np
from numpy.typing import NDArray

from gateway.alert_periods import AlertState
from gateway.file_input import decode_json
from gateway.messages import Samples

MIN_GAP_PERIODS = 1.5
"""A longer distance between neighbouring samples, in periods, is a gap. Basis: a lost sample makes two periods, jitter less than
one and a half."""
MAX_LISTED_GAPS = 200
"""The longest gaps are listed, all are counted. Basis: a choice; more than anybody reads, and some kilobytes."""
SUMMARY = "summary.json"
SUMMARY_MEDIA_TYPE = "application/json"
SUMMARY_VERSION = 1


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


def _period_ns(first_ns: NDArray[np.int64], last_ns: NDArray[np.int64], length: NDArray[np.int64]) -> float | None:
    """Return the median distance of neighbouring samples, inside blocks and between them."""
    inside = length > 1
    periods_ns = np.concatenate([(last_ns - first_ns)[inside] / (length[inside] - 1), first_ns[1:] - last_ns[:-1]])
    return float(np.median(periods_ns)) if len(periods_ns) else None


@dataclass(frozen=True, slots=True)
class TopicCount:
    """The messages of one topic."""

    count: int
    bytes: int
    """Of all messages, before compression."""


@dataclass(frozen=True, slots=True)
class CalibrationState:
    """The calibration in force, and the state of a recalibration, from one change until the next."""

    log_time_ns: int
    utc_ns: int
    calibration_id: str | None
    status: str
    text: str
    phase: str
    by: str
    session_text: str


@dataclass(frozen=True, slots=True)
class ClockChange:
    """The quality of the clock from this time on, or a step of the wall clock."""

    log_time_ns: int
    quality: str
    wall_offset_ns: int
    stepped: bool


@dataclass(frozen=True, slots=True)
class FaultCount:
    """A count of faults or of dropped items since the start of the gateway, when it had changed."""

    utc_ns: int
    name: str
    count: int


@dataclass(frozen=True, slots=True)
class LogLine:
    """A warning or an error in the log."""

    utc_ns: int
    level: int
    name: str
    message: str


@dataclass(frozen=True, slots=True)
class RecordedMark:
    """A mark that somebody set over the bus."""

    utc_ns: int
    by: str
    text: str
    reason: str = ""


@dataclass(frozen=True, slots=True)
class RecordedPeak:
    """The largest angle that the gateway reported."""

    time_ns: int
    phi_max_deg: float
    u_deg: float | None


@dataclass(frozen=True, slots=True)
class SegmentSummary:
    """What happened in a segment; every list in order of time."""

    version: int
    from_ns: int
    """Gateway time of the first message."""
    to_ns: int
    topics: dict[str, TopicCount]
    samples: SampleSummary | None
    alerts: list[AlertState]
    calibrations: list[CalibrationState]
    clock: list[ClockChange]
    """The first state, each change of quality, each step, and the last state."""
    faults: list[FaultCount]
    log: list[LogLine]
    log_count: int
    """Number of all warnings and errors."""
    largest_swing: RecordedPeak | None
    """The largest swing over one period, by the topic `swing`."""
    largest_angle: RecordedPeak | None
    """The largest angle at any moment, by the topic `motion`."""
    verdict_s: dict[str, float]
    """Seconds of each verdict of the condition."""
    marks: list[RecordedMark] = field(default_factory=list)

    @property
    def wall_offset_ns(self) -> int:
        """UTC of the wall clock minus gateway time, by the last message of the clock; 0 without one."""
        return self.clock[-1].wall_offset_ns if self.clock else 0

    @property
    def message_count(self) -> int:
        """Number of all messages."""
        return sum(topic.count for topic in self.topics.values())


def encode_summary(summary: SegmentSummary) -> bytes:
    """Return the content of the attachment."""
    return msgspec.json.encode(summary)


def decode_summary(content: bytes) -> SegmentSummary | None:
    """Return the summary of an attachment; None where it is damaged or of another version."""
    try:
        summary = decode_json(content, SegmentSummary)
    except ValueError:
        return None
    return summary if summary.version == SUMMARY_VERSION else None


def calibration_key(state: CalibrationState) -> tuple[str | None, str, str]:
    """Return what a change of calibration changes."""
    return state.calibration_id, state.status, state.phase
