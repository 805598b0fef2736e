"""The outbox: changes of alerts on the disk before they are sent, for receivers that have missed some.

A change is a line: checksum, boot id, number, and the message as it is sent. Lines are appended and synced, and the oldest files
are deleted. `append` is called by one thread; `page_after` may be called by others at the same time, because lines never change.
"""

import os
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from gateway.atomic_io import make_folder, sync_folder

MAX_DIGITS = 18
"""Digits of a number. Basis: Python refuses to read one of thousands; 18 digits fit 64 bits."""
MAX_PAGE_BYTES = 48_000
"""Size of a page. Basis: a message on the bus may have 64 KiB."""
FOLDER = "alerts"
FIRST_NAME = "changes-00000000.log"
FILE_CHANGES = 256
"""Changes in a file. Basis: a choice; a file is rewritten as a whole, and files are deleted one by one."""
MAX_OUTBOX_FILES = 40
"""Basis: a choice; with files of some 400 kB, at most 16 MB and 10 000 changes."""
KEPT_FILES = 4
"""The newest files are kept at any age, because the clock may have been wrong. Basis: a choice; a thousand changes, some 2 MB."""
KEPT_S = 45 * 86400.0
"""Age at which a file is deleted. Basis: GB/T 28264 asks records of 30 working days."""


@dataclass(frozen=True, slots=True)
class StoredChange:
    """A change, identified by boot id and number: where the disk had failed, a number can occur in two boots."""

    boot_id: str
    number: int
    payload: bytes
    """The alert message as JSON, in one line."""


def encode_line(change: StoredChange) -> bytes:
    """Return a change as a line. Raises `ValueError` for a boot id or a payload that does not fit on one."""
    if not change.boot_id or " " in change.boot_id or b"\n" in change.payload:
        raise ValueError(f"change {change.number}: boot id {change.boot_id!r} or payload is no part of a line")
    content = b"%s %d %s" % (change.boot_id.encode(), change.number, change.payload)
    return b"%08x %s\n" % (zlib.crc32(content), content)


def parse_line(line: bytes) -> StoredChange | None:
    """Return the change of a line without its line end; None where it is damaged."""
    checksum, _, content = line.partition(b" ")
    if checksum != b"%08x" % zlib.crc32(content):
        return None
    parts = content.split(b" ", 2)
    if len(parts) != 3 or not parts[1].isdigit() or len(parts[1]) > MAX_DIGITS:
        return None
    return StoredChange(parts[0].decode(errors="replace"), int(parts[1]), parts[2])


def parse_lines(content: bytes) -> Iterator[StoredChange]:
    """Yield the readable changes of a file; an incomplete last line is left out."""
    complete, _, _ = content.rpartition(b"\n")
    for line in complete.split(b"\n"):
        change = parse_line(line)
        if change is not None:
            yield change


def readable_size(content: bytes) -> int:
    """Return the number of bytes without an incomplete or damaged end, behind which a line can be appended."""
    size = content.rfind(b"\n") + 1
    while size:
        begin = content.rfind(b"\n", 0, size - 1) + 1
        if parse_line(content[begin : size - 1]) is not None:
            break
        size = begin
    return size


@dataclass(frozen=True, slots=True)
class Position:
    """The last change that a receiver has."""

    number: int
    """0: it has none."""
    boot_id: str | None = None
    """None: the number alone counts."""


@dataclass(frozen=True, slots=True)
class ChangePage:
    """Changes behind a position, in order."""

    changes: list[StoredChange]
    more: bool
    """More of them did not fit."""
    complete: bool
    """The position was found; without it these are the oldest that are kept, and changes before them may be missing."""


FileSpan = dict[str, tuple[int, int]]
"""The first and the last number of each boot in a file."""


def span_of(changes: Iterable[StoredChange]) -> FileSpan:
    """Return the numbers of some changes."""
    span: FileSpan = {}
    for change in changes:
        first, last = span.get(change.boot_id, (change.number, change.number))
        span[change.boot_id] = min(first, change.number), max(last, change.number)
    return span


def find_span(spans: Sequence[FileSpan], position: Position) -> int | None:
    """Return the place of the first span from which on the changes behind a position are complete; None without one."""
    if position.boot_id is None:
        return _find_number(spans, position.number)
    for place in reversed(range(len(spans))):
        first, last = spans[place].get(position.boot_id, (1, 0))
        if first <= position.number <= last:
            return place
    return None


def _find_number(spans: Sequence[FileSpan], number: int) -> int | None:
    ranges = [(place, first, last) for place, span in enumerate(spans) for first, last in span.values()]
    if ranges and ranges[0][1] > number + 1:
        return None  # changes before the oldest were deleted
    return next((place for place, _, last in ranges if last > number), len(spans))


def make_page(kept: Iterable[StoredChange], position: Position, most_bytes: int, *, is_known: bool) -> ChangePage:
    """Return the first page of the changes behind a position, or of all where the position is not known."""
    chosen: list[StoredChange] = []
    size = 0
    for change in _changes_behind(kept, position) if is_known else kept:
        size += len(change.payload)
        if chosen and size > most_bytes:
            return ChangePage(chosen, more=True, complete=is_known)
        chosen.append(change)
    return ChangePage(chosen, more=False, complete=is_known)


def _changes_behind(changes: Iterable[StoredChange], position: Position) -> Iterator[StoredChange]:
    """Yield the changes that follow a position which is among them."""
    is_passed = is_reached = False
    for change in changes:
        if not is_passed:
            is_own = position.boot_id in (None, change.boot_id)
            if is_own and change.number <= position.number:
                is_reached = True
                continue
            is_passed = is_own or is_reached
        if is_passed:
            yield change


class AlertOutbox:
    """`<data_dir>/alerts`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._descriptor: int | None = None
        self._count = 0
        """Changes in the last file."""
        self._spans: dict[Path, FileSpan] = {}
        """Spans of the files that do not grow any more."""

    def open(self) -> int:
        """Open the last file, without an incomplete end; return the largest number in it, 0 for none. Raises `OSError`."""
        make_folder(self._folder)
        paths = self._paths()
        numbers = [0]
        for path in reversed(paths):
            numbers += [change.number for change in _read(path)]
            if len(numbers) > 1:
                break
        self._open_file(paths[-1] if paths else _unused(self._folder / FIRST_NAME))
        return max(numbers)

    def append(self, changes: Sequence[StoredChange]) -> None:
        """Write changes to the disk. Raises `OSError`; the next call then opens the files again."""
        try:
            if self._descriptor is None:
                self.open()
            if self._count >= FILE_CHANGES:
                self._begin_file()
            self._write(b"".join(map(encode_line, changes)))
        except OSError:
            self.close()
            raise
        self._count += len(changes)

    def page_after(
        self, position: Position, unstored: Sequence[StoredChange] = (), most_bytes: int = MAX_PAGE_BYTES
    ) -> ChangePage:
        """Return the changes behind a position; `unstored` are those that follow the files. Raises `OSError`."""
        paths = self._paths()
        spans = [*map(self._span, paths), span_of(unstored)]
        place = find_span(spans, position)
        kept = chain(chain.from_iterable(map(_read, paths[place or 0 :])), unstored)
        return make_page(kept, position, most_bytes, is_known=place is not None)

    def newest(self, count: int) -> list[StoredChange]:
        """Return the last changes that are kept, oldest first. Raises `OSError`."""
        changes: list[StoredChange] = []
        for path in reversed(self._paths()):
            if len(changes) >= count:
                break
            changes = _read(path) + changes
        return changes[-count:]

    def close(self) -> None:
        """Close the file."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _span(self, path: Path) -> FileSpan:
        """Return the numbers in a file."""
        span = self._spans.get(path) or span_of(_read(path))
        if path.with_name(_next_name(path)).exists():
            self._spans[path] = span
        return span

    def _paths(self) -> list[Path]:
        """Return the files in order; what is no regular file is not the gateway's, and stays as it is."""
        return sorted(path for path in self._folder.glob("changes-*.log") if path.is_file() and not path.is_symlink())

    def _open_file(self, path: Path) -> None:
        self.close()
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW, 0o640)
        content = path.read_bytes()
        size = readable_size(content)
        if size < len(content):
            os.ftruncate(self._descriptor, size)
        self._count = content[:size].count(b"\n")
        sync_folder(self._folder)

    def _begin_file(self) -> None:
        last = self._paths()[-1]
        self._open_file(_unused(last.with_name(_next_name(last))))
        paths = self._paths()
        excess = max(len(paths) - MAX_OUTBOX_FILES, 0)
        old_s = time.time() - KEPT_S
        for place, path in enumerate(paths[:-KEPT_FILES]):
            if place < excess or path.stat().st_mtime < old_s:
                path.unlink(missing_ok=True)
                self._spans.pop(path, None)

    def _write(self, content: bytes) -> None:
        assert self._descriptor is not None
        while content:
            content = content[os.write(self._descriptor, content) :]
        os.fdatasync(self._descriptor)


def _unused(path: Path) -> Path:
    """Return this name, or the next one that nothing has."""
    while os.path.lexists(path):
        path = path.with_name(_next_name(path))
    return path


def _next_name(path: Path) -> str:
    return f"changes-{int(path.stem.removeprefix('changes-')) + 1:08d}.log"


def _read(path: Path) -> list[StoredChange]:
    """Return the changes of a file; none where it was deleted meanwhile."""
    try:
        return list(parse_lines(path.read_bytes()))
    except FileNotFoundError:
        return []
