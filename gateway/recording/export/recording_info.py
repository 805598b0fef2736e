"""The contents of a timeline, for `plumbline record info`."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from devices.errors import RecordingError
from gateway import messages
from gateway.recording.chain.missing_files import describe_hidden, missing_of
from gateway.recording.export.gaps import RecordingGap, SampleInfo, describe_overlaps, join_samples
from gateway.recording.format import content as names
from gateway.recording.format.salvage import SalvageReport, describe_losses, may_hide_messages, sum_losses
from gateway.recording.format.segment_summary import (
    CalibrationState,
    ClockChange,
    FaultCount,
    LogLine,
    RecordedMark,
    RecordedPeak,
    SegmentSummary,
    TopicCount,
    calibration_key,
)
from gateway.recording.format.summary_builder import RecordedAlert, join_alerts, largest_peak, unknown_s, verdicts_s
from gateway.recording.reading.interval import WHOLE_RECORDING, RecordingInterval
from gateway.recording.reading.recording_file import SegmentIndex, Selection, is_altered
from gateway.recording.reading.timeline import (
    ReadSegment,
    ReportProgress,
    Timeline,
    ignore_progress,
    summarise_segment,
)
from gateway.topics import TOPICS


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One file of the timeline."""

    path: str
    size_bytes: int
    closed: bool
    losses: SalvageReport
    from_utc_ns: int
    to_utc_ns: int
    repaired: bool = False
    """It was cut off by a kill or a power failure, and completed at the next start."""


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """The messages of one topic."""

    topic: str
    schema: str
    count: int
    rate_hz: float | None
    bytes: int
    """Before compression."""


@dataclass(frozen=True, slots=True)
class ClockInfo:
    """The quality of the times."""

    quality: str
    """By the last message of the clock."""
    wall_offset_s: float
    """UTC of the wall clock minus gateway time."""
    steps: int
    changes: list[ClockChange]
    """The first state, each change of quality, and each step."""


@dataclass(frozen=True, slots=True)
class RecordingInfo:
    """The contents of the recordings of one gateway; None: not known. Every list is in order of time."""

    gateway: str
    path: str
    """The file, or the first and the last."""
    files: list[FileInfo]
    remarks: list[str]
    """Files that were left out, files that are missing, and files that overlap."""
    hidden: list[str]
    """What was recorded and is missing or cannot be read: alerts may have been in it."""
    size_bytes: int
    closed: bool
    """Every file was closed properly."""
    losses: SalvageReport
    from_utc_ns: int
    to_utc_ns: int
    duration_s: float
    clock: ClockInfo | None
    topics: list[TopicInfo]
    samples: SampleInfo
    bytes_per_sample: float | None
    """Size of the files divided by the number of samples; None for a part of them."""
    gaps: list[RecordingGap]
    """The longest gaps of each segment, and all gaps between segments."""
    origin: dict[str, str]
    """Of the last file, as `device`."""
    device: dict[str, str]
    calibration_id: str | None
    calibration_status: str | None
    calibrations: list[CalibrationState]
    """The first calibration in force, and each change of it or of a recalibration."""
    configuration: bool
    """Whether every file contains the configuration."""
    attachments: list[str]
    """Names of all attachments, including calibration records and certificates."""
    recovered: dict[str, str] | None
    """The metadata that `record recover` wrote when it made the last file that it made."""
    alerts: list[RecordedAlert]
    unknown_s: float
    """Seconds in which no statement on the swing was possible."""
    marks: list[RecordedMark]
    """Marks that somebody set over the bus."""
    faults: list[FaultCount]
    """Each new count of faults and of dropped items, added up over all starts of the gateway."""
    log: list[LogLine]
    """Warnings and errors, at most the first thousand of each segment."""
    log_count: int
    """Number of all of them."""
    largest_swing: RecordedPeak | None
    largest_angle: RecordedPeak | None
    verdict_s: dict[str, float]
    """Seconds of each verdict of the condition."""

    def as_json(self) -> dict[str, Any]:
        """Return the content of `record info --json`."""
        return {"schema_version": messages.SCHEMA_VERSION, **asdict(self)}


def summarise_timeline(
    timeline: Timeline, interval: RecordingInterval = WHOLE_RECORDING, report: ReportProgress = ignore_progress
) -> RecordingInfo:
    """Return the contents of an interval of a timeline. Raises `RecordingError`, and `InputError` for an impossible interval."""
    selection = timeline.select(interval)
    chosen = timeline.chosen(selection)
    total, done = sum(segment.size_bytes for segment in chosen), 0
    read: list[tuple[SegmentIndex, SegmentSummary]] = []
    files: list[FileInfo] = []
    for segment in chosen:
        part = _read(timeline, segment, selection)
        if part.summary is not None:
            read.append((segment, part.summary))
            files.append(_file_info(segment, part.summary, part.losses))
        done += segment.size_bytes
        report(done / total)
    if not read:
        raise RecordingError(
            f"{timeline.name}: has no readable message in this interval; choose another, or another file"
        )
    hidden = describe_hidden(timeline, selection)
    return _build_info(timeline, read, files, hidden, is_whole=interval == WHOLE_RECORDING)


def _read(timeline: Timeline, segment: SegmentIndex, selection: Selection) -> ReadSegment:
    """Return the summary of the selected part of a segment, from its index where that is whole and unaltered."""
    begins = selection.begin_ns is None or selection.begin_ns <= segment.from_ns
    ends = selection.end_ns is None or segment.to_ns < selection.end_ns
    if not (begins and ends):
        return summarise_segment(segment, selection)
    if segment.summary is None or is_altered(segment):
        return timeline.read_summary(segment)
    return ReadSegment(segment.summary, SalvageReport(closed=True))


def _file_info(segment: SegmentIndex, summary: SegmentSummary, losses: SalvageReport) -> FileInfo:
    return FileInfo(
        path=str(segment.path),
        size_bytes=segment.size_bytes,
        closed=losses.closed,
        losses=losses,
        from_utc_ns=summary.from_ns + summary.wall_offset_ns,
        to_utc_ns=summary.to_ns + summary.wall_offset_ns,
        repaired=names.REPAIRED in segment.metadata and names.CUT not in segment.metadata,
    )


def _build_info(
    timeline: Timeline,
    read: Sequence[tuple[SegmentIndex, SegmentSummary]],
    files: list[FileInfo],
    hidden: list[str],
    *,
    is_whole: bool,
) -> RecordingInfo:
    segments, summaries = [segment for segment, _ in read], [summary for _, summary in read]
    from_utc_ns = min(file.from_utc_ns for file in files)
    to_utc_ns = max(file.to_utc_ns for file in files)
    duration_s = (to_utc_ns - from_utc_ns) / 1e9
    samples, gaps = join_samples(read)
    size_bytes = sum(file.size_bytes for file in files)
    calibrations = _calibration_changes(summaries)
    metadata = [segment.metadata for segment in segments]
    recovered = [content[names.RECOVERED] for content in metadata if names.RECOVERED in content]
    return RecordingInfo(
        gateway=timeline.gateway,
        path=timeline.name,
        files=files,
        remarks=[
            *timeline.remarks,
            *hidden,
            *missing_of(timeline).remarks,
            *describe_overlaps(read),
        ],
        hidden=[*hidden, *_unreadable(files)],
        size_bytes=size_bytes,
        closed=all(file.closed for file in files),
        losses=sum_losses([file.losses for file in files]),
        from_utc_ns=from_utc_ns,
        to_utc_ns=to_utc_ns,
        duration_s=duration_s,
        clock=_clock_info(summaries),
        topics=_topic_infos(summaries, duration_s),
        samples=samples,
        bytes_per_sample=size_bytes / samples.count if samples.count and is_whole else None,
        gaps=gaps,
        origin=metadata[-1].get(names.ORIGIN, {}),
        device=metadata[-1].get(names.DEVICE, {}),
        calibration_id=calibrations[-1].calibration_id if calibrations else None,
        calibration_status=calibrations[-1].status if calibrations else None,
        calibrations=calibrations,
        configuration=all(names.CONFIGURATION in segment.attachments for segment in segments),
        attachments=sorted({name for segment in segments for name in segment.attachments}),
        recovered=recovered[-1] if recovered else None,
        alerts=join_alerts([(segment.boot_id, summary) for segment, summary in read]),
        unknown_s=unknown_s(summaries),
        marks=[mark for summary in summaries for mark in summary.marks],
        faults=_fault_changes(read),
        log=[line for summary in summaries for line in summary.log],
        log_count=sum(summary.log_count for summary in summaries),
        largest_swing=largest_peak([summary.largest_swing for summary in summaries]),
        largest_angle=largest_peak([summary.largest_angle for summary in summaries]),
        verdict_s=verdicts_s(summaries),
    )


def _unreadable(files: Sequence[FileInfo]) -> list[str]:
    """Return a line for each file of which something cannot be read."""
    damaged = (each for each in files if may_hide_messages(each.losses))
    return [f"{Path(each.path).name}: {', '.join(describe_losses(each.losses))}" for each in damaged]


def _calibration_changes(summaries: Sequence[SegmentSummary]) -> list[CalibrationState]:
    changes: list[CalibrationState] = []
    for state in (state for summary in summaries for state in summary.calibrations):
        if not changes or calibration_key(changes[-1]) != calibration_key(state):
            changes.append(state)
    return changes


def _fault_changes(read: Sequence[tuple[SegmentIndex, SegmentSummary]]) -> list[FaultCount]:
    """Return each new count, added up over all starts; every segment begins with the counts since the start of the gateway."""
    counts: dict[tuple[str, str], int] = {}
    total: Counter[str] = Counter()
    changes = []
    for segment, summary in read:
        for fault in summary.faults:
            key = segment.boot_id, fault.name
            if more := fault.count - counts.get(key, 0):
                total[fault.name] += more
                changes.append(replace(fault, count=total[fault.name]))
            counts[key] = fault.count
    return changes


def _clock_info(summaries: Sequence[SegmentSummary]) -> ClockInfo | None:
    states = [state for summary in summaries for state in summary.clock]
    if not states:
        return None
    changes = [state for before, state in zip([None, *states], states, strict=False) if _is_clock_change(before, state)]
    steps = sum(state.stepped for state in changes)
    return ClockInfo(states[-1].quality, states[-1].wall_offset_ns / 1e9, steps, changes)


def _is_clock_change(before: ClockChange | None, state: ClockChange) -> bool:
    """Return whether quality or offset changed; a segment repeats the last clock message of the one before."""
    if before is None or before.quality != state.quality:
        return True
    return state.stepped and before.wall_offset_ns != state.wall_offset_ns


def _topic_infos(summaries: Sequence[SegmentSummary], duration_s: float) -> list[TopicInfo]:
    found: dict[str, TopicCount] = {}
    for name, count in (entry for summary in summaries for entry in summary.topics.items()):
        before = found.get(name, TopicCount(0, 0))
        found[name] = TopicCount(before.count + count.count, before.bytes + count.bytes)
    schemas = {topic.path: topic.schema_name for topic in TOPICS.values()}
    return [
        TopicInfo(name, schemas.get(name, ""), each.count, each.count / duration_s if duration_s else None, each.bytes)
        for name, each in sorted(found.items())
    ]
