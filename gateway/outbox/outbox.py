"""The files of the outbox: lines are appended and synced, the oldest files are deleted.

`append` is called by one thread; `page_after` may be called by others at the same time, because lines never change.
"""

import os
import time
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from gateway.atomic_io import make_folder, sync_folder
from gateway.outbox.change import StoredChange, encode_line, parse_lines, readable_size
from gateway.outbox.position import MAX_PAGE_BYTES, ChangePage, FileSpan, Position, find_span, make_page, span_of

FOLDER = "alerts"
FIRST_NAME = "changes-00000000.log"
FILE_CHANGES = 256
"""Changes in a file. Basis: a choice; a file is rewritten as a whole, and files are deleted one by one."""
MAX_OUTBOX_FILES = 40
"""With files of some 400 kB, at most 16 MB and 10 000 changes. Basis: a choice; with files of some 400 kB, at most 16 MB and 10
000 changes."""
KEPT_FILES = 4
"""The newest files are kept at any age, because the clock may have been wrong. Basis: a choice; a thousand changes, some 2 MB."""
KEPT_S = 45 * 86400.0
"""Age at which a file is deleted. Basis: GB/T 28264 asks records of 30 working days."""


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
