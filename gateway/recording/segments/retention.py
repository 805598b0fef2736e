"""The names of segments, and the deletion of segments beyond the quota."""

import math
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

from gateway.recording.chain.statements import DeletionReason
from gateway.recording.segments.events import is_trimmed, marker_path, uncompacted_marker
from gateway.units import BYTES_PER_MB

USED_SHARE = 0.95
"""Share of recordings and free space together that recordings may take; the rest is for compaction and state files. Basis: a
choice; a compaction needs a segment's room, and a share of a twentieth is not missed."""

MIN_EVENT_SHARE = 0.1
"""Share of the disk to which segments with events make room where it is full. Basis: a choice; recording goes on although every
segment has events, and another program that fills the disk cannot take them all."""
UTC_FORMAT = "%Y%m%dT%H%M%SZ"


class Protection(IntEnum):
    """What the quota does with a segment, in this order."""

    NONE = 0
    """Nothing happened in it or shortly before or after: it is deleted first."""
    EVENT = 1
    """It is trimmed to the time around its events."""
    TRIMMED = 2
    """It is deleted last."""


@dataclass(frozen=True, slots=True, order=True)
class ClosedSegment:
    """A segment that is not open. Segments sort in the order in which the quota takes their bytes, oldest first."""

    protection: Protection
    utc: str
    copy: int
    path: Path
    size_bytes: int


@dataclass(frozen=True, slots=True)
class SegmentNames:
    """The names of one gateway's segments: `<site>-<crane>-<sensor>-<UTC>[-<copy>].mcap`."""

    site: str
    crane: str
    sensor: str

    def unused_path(self, data_dir: Path, start_ns: int) -> Path:
        """Return the path of a segment that starts now; no file has this name yet."""
        utc = datetime.fromtimestamp(start_ns // 1_000_000_000, tz=UTC).strftime(UTC_FORMAT)
        path = data_dir / f"{self._prefix}-{utc}.mcap"
        copy = 0
        while path.exists():
            copy += 1
            path = data_dir / f"{self._prefix}-{utc}-{copy}.mcap"
        return path

    def list_segments(self, data_dir: Path) -> list[ClosedSegment]:
        """Return this gateway's segments in the order of deletion, incomplete ones included. Raises `OSError`."""
        pattern = re.compile(self._pattern)
        found = []
        for path in data_dir.iterdir():
            match = pattern.fullmatch(path.name)
            if match:
                with suppress(FileNotFoundError):
                    size_bytes = path.stat().st_size
                    found.append(ClosedSegment(_protection(path), match[1], int(match[2] or 0), path, size_bytes))
        return sorted(found)

    def list_uncompacted(self, data_dir: Path) -> list[Path]:
        """Return the segments that a former run began and did not compact, oldest first. Raises `OSError`."""
        return [segment.path for segment in self.list_segments(data_dir) if uncompacted_marker(segment.path).exists()]

    def remove_unfinished(self, data_dir: Path) -> None:
        """Delete what a killed gateway had begun: segments in which nothing was recorded, and copies. Raises `OSError`."""
        pattern = re.compile(rf"\.{self._pattern}\.part")
        for path in data_dir.iterdir():
            if pattern.fullmatch(path.name):
                path.unlink(missing_ok=True)

    @property
    def _pattern(self) -> str:
        return re.escape(self._prefix) + r"-(\d{8}T\d{6}Z)(?:-(\d+))?\.mcap"

    @property
    def _prefix(self) -> str:
        return f"{self.site}-{self.crane}-{self.sensor}"


def _protection(path: Path) -> Protection:
    if not marker_path(path).exists():
        return Protection.NONE
    return Protection.TRIMMED if is_trimmed(path) else Protection.EVENT


class DiskSpace(NamedTuple):
    """The size of a disk and what is free of it, bytes."""

    size_bytes: float
    free_bytes: float


def disk_space(folder: Path) -> DiskSpace:
    """Return the space of the disk; infinite where it is not known."""
    try:
        usage = shutil.disk_usage(folder)
    except OSError:
        return DiskSpace(math.inf, math.inf)
    return DiskSpace(usage.total, usage.free)


class Retention:
    """Deletes closed segments beyond the quota, oldest first, and touches no other file.

    Where only segments with events are left, it asks for the oldest one to be trimmed to the time around them. When all are
    trimmed, or cannot be, the oldest one is deleted, but not before `keep_events_days`: younger ones stay whatever the quota.
    Where the disk is smaller than the quota or full, all make room in the same order, those with events as long as the recordings
    take more than `MIN_EVENT_SHARE` of it.
    """

    def __init__(
        self,
        names: SegmentNames,
        data_dir: Path,
        quota_mb: float,
        before_deletion: Callable[[Path, DeletionReason], None] = lambda path, reason: None,
        space: Callable[[Path], DiskSpace] = disk_space,
        keep_events_days: float = 0.0,
    ) -> None:
        """`before_deletion` is called with each segment that is to be deleted and the reason, and may raise `OSError`."""
        self._space = space
        self._keep_events = timedelta(days=keep_events_days)
        self._before_deletion = before_deletion
        self._names = names
        self._data_dir = data_dir
        self._quota_bytes = quota_mb * BYTES_PER_MB
        self._closed: list[ClosedSegment] = []
        self._asked: set[Path] = set()
        self._to_trim: list[Path] = []
        self.undeletable = 0

    def rescan(self) -> None:
        """Find the segments, while none of them is open. Raises `OSError`."""
        self._closed = self._names.list_segments(self._data_dir)
        self._asked &= {segment.path for segment in self._closed}

    def take_segments_to_trim(self) -> list[Path]:
        """Return the segments that shall be trimmed since the last call; their sizes count again after a `rescan`."""
        taken, self._to_trim = self._to_trim, []
        return taken

    def enforce(self, open_bytes: int) -> list[Path]:
        """Delete segments until all together are within the quota; return the deleted paths.

        A file that cannot be deleted is counted, and tried again after the next `rescan`; recording continues.
        """
        deleted = []
        total_bytes = open_bytes + sum(segment.size_bytes for segment in self._closed)
        space = self._space(self._data_dir)
        disk_bytes = USED_SHARE * (total_bytes + space.free_bytes)
        while choice := self._choose(total_bytes, disk_bytes, MIN_EVENT_SHARE * space.size_bytes):
            oldest, reason = choice
            self._closed.remove(oldest)
            if oldest.protection is Protection.EVENT and oldest.path not in self._asked:
                self._asked.add(oldest.path)
                self._to_trim.append(oldest.path)
                break  # what that makes free is not known yet
            try:
                self._before_deletion(oldest.path, reason)
                oldest.path.unlink(missing_ok=True)
                marker_path(oldest.path).unlink(missing_ok=True)
                uncompacted_marker(oldest.path).unlink(missing_ok=True)
            except OSError:
                self.undeletable += 1
                continue
            total_bytes -= oldest.size_bytes
            deleted.append(oldest.path)
        return deleted

    def _choose(
        self, total_bytes: float, disk_bytes: float, event_bytes: float
    ) -> tuple[ClosedSegment, DeletionReason] | None:
        """Return the segment that makes room next and why; None where there is room, or none may."""
        if total_bytes > self._quota_bytes:
            newest = max((segment.utc for segment in self._closed), default="")
            for segment in self._closed:
                may_be_trimmed = segment.protection is Protection.EVENT and segment.path not in self._asked
                if segment.protection is Protection.NONE or may_be_trimmed or self._is_old(segment, newest):
                    return segment, "quota"
        if total_bytes > disk_bytes and self._closed:
            oldest = self._closed[0]
            if oldest.protection is Protection.NONE or total_bytes > event_bytes:
                return oldest, "disk"
        return None

    def _is_old(self, segment: ClosedSegment, newest_utc: str) -> bool:
        """Return whether the time has passed for which a segment with events stays; the clock may have been wrong."""
        try:
            age = datetime.strptime(newest_utc, UTC_FORMAT) - datetime.strptime(segment.utc, UTC_FORMAT)
        except ValueError:
            return True
        return age >= self._keep_events
