"""The audit: every authorised request and its outcome, one line each, on the disk before the request is executed."""

import json
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway.atomic_io import append_durably, append_line

MAX_AUDIT_BYTES = 8_000_000
"""Size at which the file becomes the previous file; there is one previous file. Basis: a choice; years of changes, and two files
are nothing to a card."""


class Audit:
    """`<data_dir>/calibration/audit.jsonl`; every entry is also logged, and so recorded."""

    def __init__(self, path: Path, log_line: Callable[[str], None]) -> None:
        self._path = path
        self._log_line = log_line

    def write(self, time_utc: str, event: str, *, durable: bool = True, **content: Any) -> None:
        """Append an entry, and wait for the disk where it is to be durable. Raises `OSError`."""
        line = json.dumps({"time_utc": time_utc, "event": event, **content})
        self._log_line(f"audit {line}")
        if self._path.exists() and self._path.stat().st_size > MAX_AUDIT_BYTES:
            self._path.replace(self._path.with_suffix(".previous.jsonl"))
        (append_durably if durable else append_line)(self._path, line.encode())

    def newest(self, count: int) -> list[dict[str, Any]]:
        """Return the last entries of the file, oldest first, without a line that a kill has truncated. Raises `OSError`."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            lines = deque(file, maxlen=count)
        return [entry for entry in map(_parse_entry, lines) if entry is not None]


def _parse_entry(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None
