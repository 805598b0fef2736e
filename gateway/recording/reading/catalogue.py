"""The timelines of files and folders: one for each gateway."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from devices.errors import RecordingError
from gateway.recording.format.header import RECOVERED
from gateway.recording.reading.recording_file import read_index
from gateway.recording.reading.timeline import Timeline, TimelineSegment


class NoMessageError(RecordingError):
    """A recording has ended, or is read, before its first message."""


def open_timelines(paths: Sequence[Path]) -> list[Timeline]:
    """Return the timelines of files, and of the `.mcap` files in folders, in the order of their first messages.

    A file without a message, and in a folder a file that cannot be read, is left out with a remark. Raises `RecordingError`
    where a file that was named cannot be read, or nothing has a message.
    """
    named = {path for path in paths if not path.is_dir()}
    segments: list[TimelineSegment] = []
    problems: list[RecordingError] = []
    for file in list_recordings(paths):
        try:
            segments.append(_open_segment(file))
        except RecordingError as error:
            if file in named and not isinstance(error, NoMessageError):
                raise
            problems.append(error)
    if not segments:
        raise problems[0]
    segments, replaced = _without_recovered_sources(segments)
    remarks = (*(f"{problem}; it is left out" for problem in problems), *replaced)
    names = sorted({segment.gateway for segment in segments})
    timelines = [
        Timeline(name, _in_order(each for each in segments if each.gateway == name), remarks) for name in names
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


def _open_segment(path: Path) -> TimelineSegment:
    index = read_index(path)
    if index.from_ns is None:
        raise NoMessageError(f"{path}: has no message; the gateway was stopped before it wrote one")
    return TimelineSegment(path, index)


def _in_order(segments: Iterable[TimelineSegment]) -> tuple[TimelineSegment, ...]:
    return tuple(sorted(segments, key=lambda segment: (segment.from_ns, segment.to_ns, segment.path)))


def _without_recovered_sources(segments: Sequence[TimelineSegment]) -> tuple[list[TimelineSegment], list[str]]:
    """Return the segments without those of which a recovered copy is given too, and a remark on each."""
    by_path = {segment.path.resolve(): segment for segment in segments}
    dropped: dict[Path, str] = {}
    for copy in segments:
        name = copy.index.metadata.get(RECOVERED, {}).get("from")
        source = None if name is None else by_path.get(copy.path.resolve().with_name(name))
        if source is None or source.path in dropped:
            continue
        older, newer = (source, copy) if source.to_ns <= copy.to_ns else (copy, source)
        dropped[older.path] = f"{older.path.name}: left out, because {newer.path.name} has the same messages"
    return [segment for segment in segments if segment.path not in dropped], list(dropped.values())
