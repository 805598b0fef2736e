"""Recordings of a gateway as one timeline: files and folders of any size, joined segment by segment.

Every command that reads recordings gets them from here. The segments are listed by their indexes; their messages are read one
segment at a time, so that memory does not grow with the number of files.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from filecmp import cmp
from math import inf
from pathlib import Path
from typing import Any

from devices.block import SampleBlock
from devices.errors import RecordingError
from gateway.messages import Samples
from gateway.packing import unpack
from gateway.recording.format.content import RECOVERED, segment_number
from gateway.recording.format.salvage import SalvageReport
from gateway.recording.format.segment_summary import SampleSummary, SegmentSummary
from gateway.recording.format.summary_builder import SummaryBuilder
from gateway.recording.reading.interval import WHOLE_RECORDING, RecordingExtent, RecordingInterval
from gateway.recording.reading.recording_file import (
    EVERYTHING,
    RecordedMessage,
    RecordingFile,
    SegmentIndex,
    Selection,
    open_recording,
    read_index,
)
from gateway.topics import paths_with

SAMPLES, CALIBRATION, CLOCK = "/samples", "/calibration", "/clock"
REPEATED_PATHS = paths_with(lambda topic: topic.repeated)
SUMMARISED_PATHS = paths_with(lambda topic: topic.summarised)
MAX_BLOCK_NS = 10_000_000_000
"""A block is recorded at the time of its newest sample, so that samples before an end may be in a message this much later. Basis:
a choice; longer than a block of any device that is read, short beside a segment."""
MESSAGES_PER_REPORT = 20
"""Progress is reported once in so many messages. Basis: a choice; a report costs more than a message, and a person sees
progress."""

ReportProgress = Callable[[float], None]
"""Takes the share of the work that is done, 0 to 1."""


def ignore_progress(share: float) -> None:
    """Report to nobody."""


@dataclass(frozen=True, slots=True)
class TimelineMessage:
    """A message with the segment and the open file that it is from."""

    segment: SegmentIndex
    file: RecordingFile
    recorded: RecordedMessage

    def decode(self) -> Any:
        """Return the content of a message of the gateway; None for others, and for unreadable ones, which are counted."""
        return self.file.decode(self.recorded)

    def samples(self) -> tuple[Samples, SampleBlock] | None:
        """Return the content of a message of samples, and its block; None where it cannot be read, which is counted."""
        content = self.decode()
        if not isinstance(content, Samples):
            return None
        try:
            return content, unpack(content)
        except ValueError:  # columns that do not match
            self.file.losses.unreadable_messages += 1
            return None


@dataclass(frozen=True, slots=True)
class TimelineSpan:
    """The first and the last sample of a timeline, in gateway time."""

    first_ns: int
    last_ns: int
    wall_offset_ns: int
    """UTC of the wall clock minus gateway time, by the last message of the clock."""

    @property
    def extent(self) -> RecordingExtent:
        """The same in seconds from the first sample, of which `--from` and `--to` count."""
        return RecordingExtent(0.0, (self.last_ns - self.first_ns) / 1e9, self.first_ns + self.wall_offset_ns)


@dataclass(frozen=True, slots=True)
class ReadSegment:
    """The summary of a segment that was read, and what of it could not be read."""

    summary: SegmentSummary | None
    losses: SalvageReport


@dataclass(frozen=True, slots=True)
class GivenFiles:
    """Everything that was given, of which timelines are made."""

    folders: tuple[Path, ...] = ()
    """Those that are given as a whole."""
    indexes: dict[Path, SegmentIndex] = field(default_factory=dict)
    """Of each file that can be read, also of those that are left out."""
    unread: dict[Path, RecordingError] = field(default_factory=dict)
    """Files that cannot be read, and why."""


@dataclass(slots=True)
class Timeline:
    """The segments of one gateway in order of time."""

    gateway: str
    segments: tuple[SegmentIndex, ...]
    remarks: tuple[str, ...] = ()
    """Files that were left out, and why."""
    given: GivenFiles = field(default_factory=GivenFiles)
    _read: dict[Path, ReadSegment] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The file, or the number of files with the first and the last."""
        first, last = self.segments[0].path, self.segments[-1].path
        return str(first) if len(self.segments) == 1 else f"{len(self.segments)} files, {first} to {last.name}"

    @property
    def size_bytes(self) -> int:
        """Size of all files."""
        return sum(segment.size_bytes for segment in self.segments)

    def messages(
        self, selection: Selection = EVERYTHING, report: ReportProgress = ignore_progress
    ) -> Iterator[TimelineMessage]:
        """Yield the messages of a selection, segment by segment in the order of writing.

        What a segment repeats of the one before is left out. Raises `RecordingError`.
        """
        seen: dict[tuple[str, str], int] = {}
        chosen = self.chosen(selection)
        total = sum(segment.size_bytes for segment in chosen)
        done = 0
        for segment in chosen:
            file, before = open_recording(segment.path), dict(seen)
            for number, recorded in enumerate(file.messages(selection)):
                if recorded.topic in REPEATED_PATHS:
                    key = file.boot_id, recorded.topic
                    if recorded.sequence <= before.get(key, -1):
                        continue
                    seen[key] = max(recorded.sequence, seen.get(key, -1))
                if number % MESSAGES_PER_REPORT == 0:
                    report((done + segment.size_bytes * _share(segment, recorded.log_time_ns)) / total)
                yield TimelineMessage(segment, file, recorded)
            done += segment.size_bytes
        report(1.0)

    def chosen(self, selection: Selection) -> list[SegmentIndex]:
        """Return the segments that may have messages of a selection."""
        return [segment for segment in self.segments if selection.may_contain(segment.from_ns, segment.to_ns)]

    def summary(self, segment: SegmentIndex) -> SegmentSummary | None:
        """Return the summary of a segment, from its index, or else by reading it; None where it has no message."""
        return segment.summary or self.read_summary(segment).summary

    def read_summary(self, segment: SegmentIndex) -> ReadSegment:
        """Read a segment, unless it was read before, and return its summary and its losses. Raises `RecordingError`."""
        if segment.path not in self._read:
            self._read[segment.path] = summarise_segment(segment)
        return self._read[segment.path]

    def span(self) -> TimelineSpan:
        """Return the times of the first and the last sample. Raises `RecordingError` without samples."""
        first = next(filter(None, map(self._samples_of, self.segments)), None)
        last = next(filter(None, map(self._samples_of, reversed(self.segments))), None)
        if first is None or last is None:
            raise RecordingError(f"{self.name}: has no samples; choose another recording")
        clocks = (summary.clock for segment in reversed(self.segments) if (summary := self.summary(segment)))
        newest = next(filter(None, clocks), None)
        return TimelineSpan(first.first_ns, last.last_ns, newest[-1].wall_offset_ns if newest else 0)

    def select(self, interval: RecordingInterval, topics: Iterable[str] | None = None) -> Selection:
        """Return the selection of an interval, and of topics; None: of all topics. Raises `InputError`, `RecordingError`."""
        wanted = None if topics is None else frozenset(topics)
        if interval == WHOLE_RECORDING:
            return Selection(topics=wanted)
        span = self.span()
        begin_s, end_s = interval.limits_s(span.extent)
        begin_ns = None if begin_s == -inf else span.first_ns + round(begin_s * 1e9)
        end_ns = None if end_s == inf else span.first_ns + round(end_s * 1e9)
        return Selection(begin_ns, end_ns, wanted)

    def _samples_of(self, segment: SegmentIndex) -> SampleSummary | None:
        summary = self.summary(segment)
        return None if summary is None else summary.samples


def summarise_segment(segment: SegmentIndex, selection: Selection = EVERYTHING) -> ReadSegment:
    """Read a segment and return its summary. Raises `RecordingError`."""
    file = open_recording(segment.path)
    builder = SummaryBuilder()
    for recorded in file.messages(selection):
        builder.count(recorded.topic, recorded.log_time_ns, len(recorded.data))
        if recorded.topic in SUMMARISED_PATHS and (content := file.decode(recorded)) is not None:
            builder.add(content, recorded.log_time_ns)
    return ReadSegment(builder.summary(), file.losses)


def _share(segment: SegmentIndex, time_ns: int) -> float:
    """Return the share of a segment that is before a time."""
    return min(max((time_ns - segment.from_ns) / max(segment.to_ns - segment.from_ns, 1), 0.0), 1.0)


class NoMessageError(RecordingError):
    """A recording has ended, or is read, before its first message."""


def open_timelines(paths: Sequence[Path]) -> list[Timeline]:
    """Return the timelines of files, and of the `.mcap` files in folders, in the order of their first messages.

    A file without a message, a second copy of a file, and in a folder a file that cannot be read, is left out with a remark.
    Raises `RecordingError` where a file that was named cannot be read, or nothing has a message.
    """
    named = {path for path in paths if not path.is_dir()}
    given = GivenFiles(tuple(path for path in paths if path.is_dir()))
    segments: list[SegmentIndex] = []
    problems: list[RecordingError] = []
    for file in list_recordings(paths):
        try:
            given.indexes[file] = read_index(file)
        except RecordingError as error:
            if file in named:
                raise
            given.unread[file] = error
            problems.append(error)
            continue
        if given.indexes[file].is_empty:
            problems.append(NoMessageError(f"{file}: has no message; the gateway was stopped before it wrote one"))
        else:
            segments.append(given.indexes[file])
    if not segments:
        raise problems[0]
    segments, copies = _without_copies(segments)
    segments, replaced = _without_recovered_sources(segments)
    remarks = (*(f"{problem}; it is left out" for problem in problems), *copies, *replaced)
    names = sorted({segment.gateway for segment in segments})
    timelines = [
        Timeline(name, _in_order(each for each in segments if each.gateway == name), remarks, given) for name in names
    ]
    return sorted(timelines, key=lambda timeline: timeline.segments[0].from_ns)


def open_timeline(paths: Sequence[Path]) -> Timeline:
    """Return the timeline of the recordings of one gateway. Raises `RecordingError`, also where they are of several."""
    first, *others = open_timelines(paths)
    if others:
        raise RecordingError(
            f"{others[0].segments[0].path}: is of gateway {others[0].gateway}, {first.segments[0].path} of {first.gateway}; "
            "give the files of one gateway"
        )
    return first


def list_recordings(paths: Sequence[Path]) -> list[Path]:
    """Return the given files, each folder replaced by its `.mcap` files. Raises `RecordingError` for one that occurs twice."""
    found: dict[Path, Path] = {}
    for path in paths:
        for file in _list_folder(path) if path.is_dir() else [path]:
            if file.resolve() in found:
                raise RecordingError(f"{file}: is given twice; give it once")
            found[file.resolve()] = file
    return list(found.values())


def _list_folder(folder: Path) -> list[Path]:
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix == ".mcap")
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be read ({error.strerror})") from error
    if not files:
        raise RecordingError(f"{folder}: contains no .mcap file; choose another folder")
    return files


def _in_order(segments: Iterable[SegmentIndex]) -> tuple[SegmentIndex, ...]:
    return tuple(sorted(segments, key=lambda segment: (segment.from_ns, segment.to_ns, segment.path)))


def _without_copies(segments: Sequence[SegmentIndex]) -> tuple[list[SegmentIndex], list[str]]:
    """Return each segment once where files have the same bytes, and a remark on each other copy.

    A damaged copy has the statement and the checksum of the sound one: bytes alone tell, and are compared where size, run and
    times agree.
    """
    kept: defaultdict[tuple[object, ...], list[SegmentIndex]] = defaultdict(list)
    remarks = []
    for segment in sorted(segments, key=_is_renamed):
        alike = kept[segment.size_bytes, segment.from_ns, segment.to_ns, segment.boot_id]
        original = next((each for each in alike if _has_same_bytes(each.path, segment.path)), None)
        if original is None:
            alike.append(segment)
        else:
            number = segment_number(segment.origin)
            same = f"the same segment {number} as" if number else "the same as"
            remarks.append(f"{segment.path.name} is {same} {original.path.name}: left out")
    return [segment for alike in kept.values() for segment in alike], remarks


def _is_renamed(segment: SegmentIndex) -> bool:
    """Return whether nothing in a file states its name: a statement about it has the one that the gateway gave it."""
    stated = (text for record in segment.metadata.values() for text in record.values())
    return not any(f'"{segment.path.name}"' in text for text in stated)


def _has_same_bytes(one: Path, other: Path) -> bool:
    with suppress(OSError):  # which whoever reads the file is told
        return cmp(one, other, shallow=False)
    return False


def _without_recovered_sources(segments: Sequence[SegmentIndex]) -> tuple[list[SegmentIndex], list[str]]:
    """Return the segments without those of which a recovered copy is given too, and a remark on each."""
    by_path = {segment.path.resolve(): segment for segment in segments}
    dropped: dict[Path, str] = {}
    for copy in segments:
        name = copy.metadata.get(RECOVERED, {}).get("from")
        source = None if name is None else by_path.get(copy.path.resolve().with_name(name))
        if source is None or source.path in dropped:
            continue
        older, newer = (source, copy) if source.to_ns <= copy.to_ns else (copy, source)
        dropped[older.path] = f"{older.path.name}: left out, because {newer.path.name} has the same messages"
    return [segment for segment in segments if segment.path not in dropped], list(dropped.values())
