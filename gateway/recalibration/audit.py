"""Who asked for what, and what came of it: one line each, on the disk before anything is done."""

import json
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway.atomic_io import append_durably

LARGEST_FILE = 8_000_000
"""Then the file becomes the previous one, of which there is one."""


class Audit:
    """`<data_dir>/calibration/audit.jsonl`; every line is told to the log too, which is recorded."""

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self._path = path
        self._tell = tell

    def write(self, time_utc: str, event: str, **content: Any) -> None:
        """Keep an entry. Raises `OSError`."""
        line = json.dumps({"time_utc": time_utc, "event": event, **content})
        self._tell(f"audit {line}")
        if self._path.exists() and self._path.stat().st_size > LARGEST_FILE:
            self._path.replace(self._path.with_suffix(".previous.jsonl"))
        append_durably(self._path, line.encode())

    def newest(self, count: int) -> list[dict[str, Any]]:
        """The last entries of the file, oldest first; a line that a kill tore is left out. Raises `OSError`."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            lines = deque(file, maxlen=count)
        return [entry for entry in map(_parsed, lines) if entry is not None]


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None
