"""The summary of a segment: everything that `record info` states, without its samples and results.

The recorder adds it to each segment that it closes, as the attachment `summary.json`, so that a day of recordings is listed in
seconds. For a segment without one it is made by reading the segment.
"""

from dataclasses import dataclass, field

import msgspec

from gateway.alert_periods import AlertState
from gateway.file_input import decode_json
from gateway.recording.summary.sample_summary import SampleSummary

SUMMARY = "summary.json"
SUMMARY_MEDIA_TYPE = "application/json"
SUMMARY_VERSION = 1


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
