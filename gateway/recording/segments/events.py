"""Events, such as alerts and marks, around which segments are kept longest, and the small files beside segments that note them.

A second kind of such a file marks the segments that have short chunks still.
"""

from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from gateway.atomic_io import append_line, write_durably
from gateway.file_input import decode_json, read_bounded
from gateway.messages import Alert, Calibration, Health, Log, Mark, Message

MARKER = ".event"
UNCOMPACTED = ".live"
TRIMMED_LINE = b"trimmed\n"
"""First line of the marker of a segment that has the time around events only."""
MAX_ENDED_RECORDINGS = 128
"""Ended recordings whose messages may still come. Basis: a choice; more than end before the disk takes them, and a bound of the
memory."""


@dataclass(frozen=True, slots=True, order=True)
class EventInterval:
    """Gateway times between which messages are kept."""

    from_ns: int
    to_ns: int


def marker_path(path: Path) -> Path:
    """Return the path of the file that marks a segment with an event."""
    return path.with_name(path.name + MARKER)


def uncompacted_marker(path: Path) -> Path:
    """Return the path of the empty file that marks a segment whose chunks are short, until its compaction."""
    return path.with_name(path.name + UNCOMPACTED)


def append_event_interval(path: Path, interval: EventInterval) -> None:
    """Note the time around an event in a segment. Raises `OSError`."""
    append_line(marker_path(path), msgspec.json.encode(interval))


def read_event_intervals(path: Path) -> list[EventInterval]:
    """Return the times around the events of a segment, in order and without overlap. Raises `OSError`."""
    merged: list[EventInterval] = []
    for interval in sorted(_parse(read_bounded(marker_path(path)))):
        if merged and interval.from_ns <= merged[-1].to_ns:
            merged[-1] = EventInterval(merged[-1].from_ns, max(merged[-1].to_ns, interval.to_ns))
        else:
            merged.append(interval)
    return merged


def _parse(content: bytes) -> list[EventInterval]:
    intervals = []
    for line in content.splitlines():
        try:
            intervals.append(decode_json(line, EventInterval))
        except ValueError:
            continue  # the mark of a trimmed segment, or a line that a power failure cut off
    return intervals


def is_trimmed(path: Path) -> bool:
    """Return whether a marked segment has been trimmed; a marker that is no file or cannot be read protects the segment."""
    with suppress(OSError):
        return read_bounded(marker_path(path)).startswith(TRIMMED_LINE)
    return False


def note_trimmed(path: Path) -> None:
    """Note that a segment has been trimmed, so that it is not trimmed again. Raises `OSError`."""
    write_durably(marker_path(path), TRIMMED_LINE)


class EventDetector:
    """Tells which messages are events: alerts, changes of the calibration, new faults, marks."""

    def __init__(self) -> None:
        self._calibration: tuple[str | None, str] | None = None
        self._faults: int | None = None

    def is_event(self, message: Message | Log) -> bool:
        """Return whether a message is an event; to be called with every message, in their order."""
        match message:
            case Mark():
                return True
            case Alert():
                return message.event in ("raised", "changed")
            case Calibration():
                before, self._calibration = self._calibration, (message.calibration_id, message.session.phase)
                return before is not None and before != self._calibration
            case Health():
                faults, self._faults = self._faults, sum(message.faults.values()) + (message.state == "recovering")
                return faults is not None and self._faults > faults
            case _:
                return False


class EventIndex:
    """Notes the time around events in a small file next to each segment, its marker, which survives a restart."""

    def __init__(self, pre_event_s: float, post_event_s: float) -> None:
        self._pre_ns = round(pre_event_s * 1e9)
        self._post_ns = round(post_event_s * 1e9)
        self._newest: EventInterval | None = None
        self._open: Path | None = None
        self._ended: deque[tuple[Path, int]] = deque(maxlen=MAX_ENDED_RECORDINGS)

    def begin_segment(self, path: Path, now_ns: int) -> None:
        """Note that a segment begins, which ends the one before. Raises `OSError`."""
        if self._open is not None:
            self._ended.append((self._open, now_ns))
        self._open = path
        if self._newest is not None and now_ns < self._newest.to_ns:
            append_event_interval(path, self._newest)

    def add_event(self, now_ns: int) -> None:
        """Note an event for the open segment, those that ended shortly before, and those that begin shortly after.

        Raises `OSError`.
        """
        interval = self._newest = EventInterval(now_ns - self._pre_ns, now_ns + self._post_ns)
        recent = [path for path, ended_ns in self._ended if ended_ns >= interval.from_ns and path.exists()]
        for path in [*recent, *([self._open] if self._open is not None else [])]:
            append_event_interval(path, interval)
