"""The evidence of an incident: its course, the files that it is from, and whether they are what the gateway wrote."""

import hashlib
import re
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from pydantic import ValidationError

from devices.errors import RecordingError
from gateway import __version__
from gateway.calibration.record import CalibrationRecord
from gateway.certificate.page import render_certificate
from gateway.incident.course import COURSE_TOPICS, CUT_OFF, REPAIRED, REPAIRED_LATER, STOPPED, Course
from gateway.incident.course_builder import CourseBuilder
from gateway.incident.incident_selection import ALERTS, IncidentWindow
from gateway.incident.sample_gaps import BlockPlace
from gateway.messages import Health
from gateway.recording.chain.missing_files import missing_of
from gateway.recording.chain.statements import REMOVED, list_missing
from gateway.recording.export.gaps import AbsenceCauses
from gateway.recording.format import content as names
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import describe_losses
from gateway.recording.reading.interval import iso_utc
from gateway.recording.reading.recording_file import RecordingFile, SegmentIndex, Selection
from gateway.recording.reading.sample_calibration import NEEDED_TOPICS, CalibratedReader
from gateway.recording.reading.timeline import (
    REPEATED_PATHS,
    SAMPLES,
    ReportProgress,
    Timeline,
    ignore_progress,
)
from gateway.recording.segments.copying import RecordCopier

CERTIFICATE_NAME = re.compile(names.CERTIFICATE.format(id=r"[A-Za-z0-9._-]+"))
"""Names of certificates: no attachment of another name is written beside the report."""
NOTHING_READ = "no message of this time could be read"
CONTEXT_LEAD_NS = 15_000_000_000
"""Calibration and clock are read from so long before the begin. Basis: both are recorded more often, calibrations every 10 s."""


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file of which the report is made."""

    path: Path
    size_bytes: int
    sha256: str
    from_ns: int
    to_ns: int
    software: str
    boot_id: str
    losses: tuple[str, ...]
    """What could not be read of it in this time; empty for a complete file."""


@dataclass(frozen=True, slots=True)
class IncidentEvidence:
    """Everything that a report states."""

    gateway: str
    """Site, crane and sensor."""
    window: IncidentWindow
    course: Course
    sources: tuple[SourceFile, ...]
    device: dict[str, str]
    certificates: dict[str, bytes]
    """The certificates of the calibration records, made from them, by their names as attachments."""
    remarks: tuple[str, ...]


def read_evidence(
    timeline: Timeline, window: IncidentWindow, cut: BinaryIO, report: ReportProgress = ignore_progress
) -> IncidentEvidence:
    """Read the time of a report once, and copy it unchanged to `cut`, a recording of its own that any reader opens.

    Raises `RecordingError`, also where it has no samples, and `CalibrationError` for a damaged record.
    """
    writer = McapWriter(cut, DENSE, defines_before_chunks=True)
    writer.start(profile=names.PROFILE, library=f"plumbline {__version__}")
    copier = RecordCopier(writer)
    builder = CourseBuilder(window.origin_ns)
    samples = CalibratedReader(timeline, Selection(window.begin_ns, window.end_ns + 1), needs_axes=False)
    files: dict[Path, RecordingFile] = {}
    wanted = Selection(window.begin_ns - CONTEXT_LEAD_NS, window.end_ns + 1)
    elsewhere = _copy_changes(timeline, window, copier, lambda time_ns: time_ns < window.begin_ns)
    for message in timeline.messages(wanted, report):
        for ended in list(files.values())[-1:] if message.file.path not in files else ():
            copier.describe(ended)  # what stands behind its last message
        files[message.segment.path] = message.file
        recorded = message.recorded
        if recorded.log_time_ns < window.begin_ns and recorded.topic not in REPEATED_PATHS:
            continue
        copier.describe(message.file)
        builder.add_run(recorded.log_time_ns, message.file.boot_id, message.file.configuration_toml)
        copier.add_message(recorded, message.file.schemas.get(recorded.channel.schema_id))
        if recorded.topic in COURSE_TOPICS:
            builder.add(recorded.log_time_ns, message.decode())
        if recorded.topic in NEEDED_TOPICS and (block := samples.add(message)) is not None:
            builder.add_block(block)
    for file in files.values():
        builder.add_device_kind(file.metadata.get(names.DEVICE, {}).get("kind", ""))
    for newest in list(files.values())[-1:]:
        copier.describe(newest)
    elsewhere |= _copy_changes(timeline, window, copier, lambda time_ns: time_ns > window.end_ns)
    before, after = _neighbours(timeline, window, builder)
    read = {each.path for each in timeline.chosen(wanted)}
    neighbours = {each.segment.path for each in (before, after) if each is not None}
    used = read | elsewhere | neighbours
    segments = _segments_to_check(timeline, used, is_first=before is None, is_last=after is None)
    course = builder.course(
        window.begin_ns,
        window.end_ns,
        before,
        after,
        AbsenceCauses.of(segments),
        end_cause="" if after is not None else _end_cause(timeline),
        checked_ns=max(segment.to_ns for segment in segments),
    )
    if not course.samples.count:
        raise RecordingError(f"{timeline.name}: has no samples in this time; choose another")
    newest = list(files.values())[-1]
    copier.add_metadata(names.CUT, _cut_metadata(timeline, window, course, list(files)))
    writer.finish()
    in_force = {str(calibration.record.get("id", "")) for _, calibration in course.calibrations}
    attachments = {name: each for file in files.values() for name, each in file.attachments.items()}
    return IncidentEvidence(
        gateway=timeline.gateway,
        window=window,
        course=course,
        sources=tuple(_source(each, files.get(each.path), is_read=each.path in read) for each in segments),
        device=newest.metadata.get(names.DEVICE, {}),
        certificates=make_certificates({name: each.data for name, each in attachments.items()}, in_force),
        remarks=(*timeline.remarks, *samples.remarks()),
    )


def _copy_changes(
    timeline: Timeline, window: IncidentWindow, copier: RecordCopier, is_wanted: Callable[[int], bool]
) -> set[Path]:
    """Copy the changes of the incident at some times, such as a late acknowledgement; return the files that they are in."""
    found: set[Path] = set()
    incident = window.incident
    for time_ns in sorted({change.time_ns for change in incident.changes} if incident else ()):
        chosen = Selection(time_ns, time_ns + 1, ALERTS)
        for message in timeline.messages(chosen) if is_wanted(time_ns) else ():
            if incident is not None and incident.is_changed_by(message.decode()):
                copier.describe(message.file)
                schema = message.file.schemas.get(message.recorded.channel.schema_id)
                copier.add_message(message.recorded, schema)
                found.add(message.segment.path)
    return found


def _segments_to_check(
    timeline: Timeline, used: Set[Path], *, is_first: bool, is_last: bool
) -> tuple[SegmentIndex, ...]:
    """Return the segments that are checked: from the first to the last one that is used, so that none is missed in between.

    They go on to the newest one where only it can state that the quota has deleted what is missing between or before them.
    """
    segments = timeline.segments
    places = [place for place, segment in enumerate(segments) if segment.path in used]
    first, end = places[0], len(segments) if is_last else places[-1] + 1
    part = segments[first:end]
    numbers = sorted({names.segment_number(each.origin) for each in part} - {0})

    def are_removed(stating: Sequence[SegmentIndex]) -> bool:
        begin = 1 if is_first else numbers[0]
        missing = list_missing(numbers, begin, numbers[-1], AbsenceCauses.of(stating).stated)
        return any(each.reason == REMOVED for each in missing)

    return segments[first:] if numbers and are_removed(part) and not are_removed(segments[first:]) else part


def _end_cause(timeline: Timeline) -> str:
    """Return why the recordings end: something that followed is not there, or the newest statement of the gateway on itself."""
    last, missing = timeline.segments[-1], missing_of(timeline)
    number = names.segment_number(last.origin)
    if following := missing.following(number):
        return following
    otherwise = CUT_OFF
    if names.REPAIRED in last.metadata:
        otherwise = REPAIRED_LATER if missing.may_go_on(number) else REPAIRED
    for segment in reversed(timeline.segments):
        stated = replace(timeline, segments=(segment,)).messages(Selection(None, None, frozenset({"/health"})))
        newest = max(stated, key=lambda message: message.recorded.log_time_ns, default=None)
        if newest is not None:
            content = newest.decode()
            return STOPPED if isinstance(content, Health) and content.state == "stopping" else otherwise
    return otherwise


def _neighbours(
    timeline: Timeline, window: IncidentWindow, builder: CourseBuilder
) -> tuple[BlockPlace | None, BlockPlace | None]:
    """Return the places of the blocks before and behind the time of a report; None: there is none."""
    blocks = frozenset({SAMPLES})

    def places(segment: SegmentIndex, selection: Selection) -> Iterator[BlockPlace]:
        for message in replace(timeline, segments=(segment,)).messages(selection):
            if (read := message.samples()) is not None:
                samples, block = read
                yield builder.place(block.time_ns, segment, message.file.boot_id, samples.sequence)

    earlier, later = Selection(None, window.begin_ns, blocks), Selection(window.end_ns + 1, None, blocks)
    before = (deque(places(each, earlier), maxlen=1) for each in reversed(timeline.segments))
    after = (next(places(each, later), None) for each in timeline.segments)
    return next((last[0] for last in before if last), None), next(filter(None, after), None)


def make_certificates(attachments: Mapping[str, bytes], in_force: Set[str]) -> dict[str, bytes]:
    """Return the certificates of the calibration records with these ids among attachments, where parents may be, too.

    They are made from the records: a page out of a recording of unknown origin would run its scripts beside the report.
    """
    records = {}
    for name in filter(CERTIFICATE_NAME.fullmatch, attachments):
        content = attachments.get(f"{name.removesuffix('.html')}.json", b"")
        with suppress(ValidationError):
            records[name] = CalibrationRecord.model_validate_json(content)
    parents = {record.id: record for record in records.values()}
    return {
        name: render_certificate(record, parents.get(record.parent or "")).encode()
        for name, record in records.items()
        if record.id in in_force
    }


def file_sha256(path: Path) -> str:
    """Return the hash of a file of any size. Raises `OSError`."""
    with path.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _cut_metadata(timeline: Timeline, window: IncidentWindow, course: Course, paths: Sequence[Path]) -> dict[str, str]:
    incident = window.incident
    return {
        "from": iso_utc(course.utc_ns(course.begin_s)),
        "to": iso_utc(course.utc_ns(course.end_s)),
        "gateway": timeline.gateway,
        "sources": ", ".join(path.name for path in paths),
        **({} if incident is None else {"incident": incident.id}),
    }


def _source(segment: SegmentIndex, file: RecordingFile | None, *, is_read: bool) -> SourceFile:
    """Return a file with its hash; `file` is None where no message of the time of the report, if it `is_read`, could be read."""
    return SourceFile(
        path=segment.path,
        size_bytes=segment.size_bytes,
        sha256=file_sha256(segment.path),
        from_ns=segment.from_ns,
        to_ns=segment.to_ns,
        software=segment.origin.get("software", "unknown"),
        boot_id=segment.boot_id,
        losses=tuple(describe_losses(file.losses)) if file is not None else (NOTHING_READ,) if is_read else (),
    )
