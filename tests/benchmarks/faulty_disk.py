"""A disk that ends the process at a chosen point: as a kill, or as a power cut that loses whatever was not synced."""

import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

PATCHED = ("open", "write", "fsync", "replace", "mkdir", "unlink", "close")


PathLike = str | Path


class FaultyDisk(AbstractContextManager["FaultyDisk", None]):
    """Counts points before and after each call that changes files below `root`, and in the middle of each write.

    `power`: what was written and not synced, and what was made or renamed in a folder that was not synced since, is undone;
    a disk may also have kept it, which is what the plain kill shows.
    """

    def __init__(self, root: Path, crash_at: int | None = None, power: bool = False) -> None:
        self._root = str(root)
        self._crash_at = crash_at
        self._power = power
        self._real = {name: getattr(os, name) for name in PATCHED}
        self._paths: dict[int, Path] = {}
        self._unsynced: dict[Path, bytes] = {}
        self._pending: list[tuple[str, Path, bytes | None]] = []
        self.points = 0

    def __enter__(self) -> "FaultyDisk":
        for name in PATCHED:
            setattr(os, name, getattr(self, f"_{name}"))
        return self

    def __exit__(self, *_error: object) -> None:
        for name, function in self._real.items():
            setattr(os, name, function)

    def _point(self) -> None:
        self.points += 1
        if self.points == self._crash_at:
            self.__exit__()
            if self._power:
                self._lose()
            os._exit(9)

    def _lose(self) -> None:
        for path, synced in self._unsynced.items():
            _put(path, synced)
        for kind, path, content in reversed(self._pending):
            if kind == "mkdir":
                path.rmdir()
            else:
                _put(path, content)

    def _ours(self, path: PathLike) -> bool:
        return str(path).startswith(self._root)

    def _open(self, path: PathLike, flags: int, *arguments: Any, **options: Any) -> int:
        ours = self._ours(path) and flags & (os.O_WRONLY | os.O_RDWR)
        if ours:
            self._point()
            path = Path(path)
            if not path.exists():
                self._pending.append(("create", path, None))
            self._unsynced.setdefault(path, path.read_bytes() if path.exists() else b"")
        descriptor: int = self._real["open"](path, flags, *arguments, **options)
        if self._ours(path):
            self._paths[descriptor] = Path(path)
        if ours:
            self._point()
        return descriptor

    def _write(self, descriptor: int, content: bytes) -> int:
        if descriptor not in self._paths:
            return int(self._real["write"](descriptor, content))
        self._point()
        half: int = self._real["write"](descriptor, content[: len(content) // 2])
        self._point()
        written = half + int(self._real["write"](descriptor, content[half:]))
        self._point()
        return written

    def _fsync(self, descriptor: int) -> None:
        path = self._paths.get(descriptor)
        if path is None:
            self._real["fsync"](descriptor)
            return
        self._point()
        self._unsynced.pop(path, None)
        if path.is_dir():
            self._pending = [entry for entry in self._pending if entry[1].parent != path]
        self._point()

    def _replace(self, source: PathLike, target: PathLike, **options: Any) -> None:
        source, target = Path(source), Path(target)
        self._point()
        self._pending.append(("replace", target, target.read_bytes() if target.exists() else None))
        self._real["replace"](source, target, **options)
        if source in self._unsynced:
            self._unsynced[target] = self._unsynced.pop(source)
        self._point()

    def _mkdir(self, path: PathLike, *arguments: Any, **options: Any) -> None:
        self._point()
        self._real["mkdir"](path, *arguments, **options)
        self._pending.append(("mkdir", Path(path), None))
        self._point()

    def _unlink(self, path: PathLike, **options: Any) -> None:
        self._point()
        self._real["unlink"](path, **options)
        self._point()

    def _close(self, descriptor: int) -> None:
        self._paths.pop(descriptor, None)
        self._real["close"](descriptor)


def _put(path: Path, content: bytes | None) -> None:
    if content is None:
        path.unlink(missing_ok=True)
    elif path.parent.exists():
        path.write_bytes(content)
