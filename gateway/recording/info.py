"""The contents of a recording, for `plumbline record info`, read in one pass."""

from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from devices.errors import RecordingError
from gateway import messages
from gateway.packing import unpack
from gateway.recording import header as names
from gateway.recording.mcap_salvage import SalvageReport
from gateway.recording.reader import RecordedMessage, RecordingFile, open_recording

GAP_PERIODS = 1.5
"""A longer distance between neighbouring samples, in periods, is a gap."""


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """The messages of one topic."""

    topic: str
    schema: str
    count: int
    rate_hz: float | None


@dataclass(frozen=True, slots=True)
class SampleInfo:
    """The samples of all blocks."""

    count: int
    rate_hz: float | None
    lost: int
    """Number of samples that the device or the link is known to have lost."""
    invalid: int
    gaps: int
    longest_gap_s: float | None
    missing_blocks: int
    """Number of blocks missing by their sequence numbers."""


@dataclass(frozen=True, slots=True)
class ClockInfo:
    """The quality of the times, by the last message of the clock."""

    quality: str
    wall_offset_s: float
    """UTC of the wall clock minus gateway time."""
    steps: int


@dataclass(frozen=True, slots=True)
class AlertEvent:
    """An alert that was raised, changed or cleared."""

    time_ns: int
    event: str
    rule: str | None
    level: str
    text: str


@dataclass(frozen=True, slots=True)
class LargestSwing:
    """The largest swing that the gateway reported."""

    time_ns: int
    phi_max_deg: float
    u_deg: float | None


@dataclass(frozen=True, slots=True)
class RecordingInfo:
    """The contents of a recording; None: not known."""

    path: str
    size_bytes: int
    closed: bool
    losses: SalvageReport
    from_utc_ns: int
    to_utc_ns: int
    """First and last log time, corrected by the last known offset of the wall clock."""
    duration_s: float
    clock: ClockInfo | None
    topics: list[TopicInfo]
    samples: SampleInfo
    bytes_per_sample: float | None
    """Size of the whole file divided by the number of samples."""
    origin: dict[str, str]
    device: dict[str, str]
    calibration_id: str | None
    calibration_status: str | None
    configuration: bool
    """Whether the file contains the configuration."""
    attachments: list[str]
    """Names of all attachments, including calibration records and certificates."""
    recovered: dict[str, str] | None
    """The metadata that `record recover` wrote when it made this file."""
    alerts: list[AlertEvent]
    largest_swing: LargestSwing | None

    def as_json(self) -> dict[str, Any]:
        """Return the content of `record info --json`."""
        return {"schema_version": messages.SCHEMA_VERSION, **asdict(self)}


def summarise(path: Path | str) -> RecordingInfo:
    """Read a recording, complete or not. Raises `RecordingError` where it is not a recording or has no message."""
    file = open_recording(path)
    builder = _SummaryBuilder()
    for recorded in file.messages():
        builder.count(recorded)
        content = file.decode(recorded)
        try:
            builder.add(content)
        except ValueError:
            file.losses.unreadable_messages += 1
    if builder.from_ns is None or builder.to_ns is None:
        raise RecordingError(f"{file.path}: has no message; the gateway was stopped before it wrote one")
    return _build_info(file, builder, builder.from_ns, builder.to_ns)


@dataclass(slots=True)
class _SummaryBuilder:
    """The contents found so far."""

    from_ns: int | None = None
    to_ns: int | None = None
    per_topic: Counter[str] = field(default_factory=Counter)
    blocks: list[tuple[int, int, int]] = field(default_factory=list)
    """First time, last time and length of each sample block."""
    sequences: list[int] = field(default_factory=list)
    lost: int = 0
    invalid: int = 0
    calibration: messages.Calibration | None = None
    clock: messages.ClockOffset | None = None
    clock_steps: int = 0
    alerts: list[AlertEvent] = field(default_factory=list)
    largest_swing: LargestSwing | None = None

    def count(self, recorded: RecordedMessage) -> None:
        self.per_topic[recorded.topic] += 1
        time_ns = recorded.log_time_ns
        self.from_ns = time_ns if self.from_ns is None else min(self.from_ns, time_ns)
        self.to_ns = time_ns if self.to_ns is None else max(self.to_ns, time_ns)

    def add(self, content: object) -> None:
        match content:
            case messages.Samples():
                self._add_samples(content)
            case messages.Calibration():
                self.calibration = content
            case messages.ClockOffset():
                self.clock = content
                self.clock_steps += content.stepped
            case messages.Alert() if content.event != "standing":
                event = AlertEvent(content.time_ns, content.event, content.rule, content.level, content.text)
                self.alerts.append(event)
            case messages.Swing(swinging=True, phi_max_deg=float(phi_max_deg)):
                if self.largest_swing is None or phi_max_deg > self.largest_swing.phi_max_deg:
                    self.largest_swing = LargestSwing(content.time_ns, phi_max_deg, content.u_deg)
            case _:
                pass

    def _add_samples(self, content: messages.Samples) -> None:
        time_ns = unpack(content).time_ns
        self.blocks.append((int(time_ns[0]), int(time_ns[-1]), len(time_ns)))
        self.sequences.append(content.sequence)
        self.lost += content.lost
        self.invalid += content.invalid

    def sample_info(self) -> SampleInfo:
        first_ns, last_ns, length = np.array(self.blocks, dtype=np.int64).reshape(-1, 3).T
        between_ns = first_ns[1:] - last_ns[:-1]
        inside = length > 1
        periods_ns = np.concatenate([(last_ns - first_ns)[inside] / (length[inside] - 1), between_ns])
        period_ns = float(np.median(periods_ns)) if len(periods_ns) else None
        gap_ns = between_ns[between_ns > GAP_PERIODS * period_ns] if period_ns else between_ns[:0]
        return SampleInfo(
            count=int(length.sum()),
            rate_hz=1e9 / period_ns if period_ns else None,
            lost=self.lost,
            invalid=self.invalid,
            gaps=len(gap_ns),
            longest_gap_s=float(gap_ns.max()) / 1e9 if len(gap_ns) else None,
            missing_blocks=int((np.diff(self.sequences) - 1).clip(min=0).sum()) if self.sequences else 0,
        )


def _build_info(file: RecordingFile, builder: _SummaryBuilder, from_ns: int, to_ns: int) -> RecordingInfo:
    samples = builder.sample_info()
    size_bytes = file.path.stat().st_size
    duration_s = (to_ns - from_ns) / 1e9
    calibration = builder.calibration
    offset_ns = builder.clock.wall_offset_ns if builder.clock else 0
    return RecordingInfo(
        path=str(file.path),
        size_bytes=size_bytes,
        closed=file.losses.closed,
        losses=file.losses,
        from_utc_ns=from_ns + offset_ns,
        to_utc_ns=to_ns + offset_ns,
        duration_s=duration_s,
        clock=ClockInfo(builder.clock.clock, offset_ns / 1e9, builder.clock_steps) if builder.clock else None,
        topics=_topics(file, builder, duration_s),
        samples=samples,
        bytes_per_sample=size_bytes / samples.count if samples.count else None,
        origin=file.metadata.get(names.ORIGIN, {}),
        device=file.metadata.get(names.DEVICE, {}),
        calibration_id=calibration.calibration_id if calibration else None,
        calibration_status=calibration.status if calibration else None,
        configuration=names.CONFIGURATION in file.attachments,
        attachments=sorted(file.attachments),
        recovered=file.metadata.get(names.RECOVERED),
        alerts=builder.alerts,
        largest_swing=builder.largest_swing,
    )


def _topics(file: RecordingFile, builder: _SummaryBuilder, duration_s: float) -> list[TopicInfo]:
    schema_of = {
        channel.topic: file.schemas[channel.schema_id].name
        for channel in file.channels.values()
        if channel.schema_id in file.schemas
    }
    return [
        TopicInfo(topic, schema_of.get(topic, ""), count, count / duration_s if duration_s else None)
        for topic, count in sorted(builder.per_topic.items())
    ]
