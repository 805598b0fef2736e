"""The security log: every refusal is counted, and written with who; a flood of them fills neither the file nor the log.

Refusals of one key, kind and name are merged: the first is written at once, then the number of further ones after a minute, two,
four, up to an hour. All together write at most one line in ten seconds after a first few.
"""

import json
import logging
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from gateway.atomic_io import append_line
from gateway.authorization.caller import RateLimit, TokenBucket

log = logging.getLogger("plumbline.security")
SECURITY_LOG_NAME = "security.jsonl"
MAX_FILE_BYTES = 4_000_000
"""Size at which the file becomes the previous file; there is one previous file. Basis: a choice; some ten thousands of lines, and
two files are nothing to a card."""
MAX_SOURCES = 64
"""Sources with a pause of their own. Basis: a choice; more than a site has callers, and a bound of the memory."""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 60.0, 3600.0
"""Pauses between two lines about one source, the first and the longest. Basis: a choice; a minute tells of a beginning, an hour
of what goes on."""
LINES = RateLimit(burst=30, per_s=0.1)
"""For all sources together. Basis: a choice; a burst tells of many sources, then six lines a minute do not fill the disk."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """One refused request or message."""

    key: str
    """The key below that of the gateway: rpc/zero, load; or page/sign-in."""
    kind: str
    name: str | None
    """Authenticated name, where there is one."""
    reason: str


@dataclass(slots=True)
class _Source:
    """The refusals of one key, kind and name."""

    next_ns: int
    pause_s: float = FIRST_PAUSE_S
    unwritten: int = 0


class SecurityLog:
    """`<data_dir>/security.jsonl`, apart from the audit of what was done."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._sources: OrderedDict[tuple[str, str, str | None], _Source] = OrderedDict()
        self._lines = TokenBucket(LINES)
        self.counts: Counter[str] = Counter()
        """Refusals since start, by kind."""
        self.write_failures = 0

    def add(self, refusal: Refusal, origin: Callable[[], str], now_ns: int, number: int = 1) -> None:
        """Count refusals, and write them where that is due; `origin` is asked for what is written alone."""
        self.counts[refusal.kind] += number
        key = (refusal.key, refusal.kind, refusal.name)
        source = self._sources.setdefault(key, _Source(next_ns=now_ns))
        self._sources.move_to_end(key)
        while len(self._sources) > MAX_SOURCES:
            self._sources.popitem(last=False)
        source.unwritten += number
        if now_ns < source.next_ns or not self._lines.take(now_ns):
            return
        self._write(refusal, origin(), source.unwritten)
        source.unwritten = 0
        source.next_ns = now_ns + round(source.pause_s * 1e9)
        source.pause_s = min(2 * source.pause_s, LONGEST_PAUSE_S)

    def _write(self, refusal: Refusal, origin: str, count: int) -> None:
        who = origin if refusal.name is None else f"{refusal.name} at {origin}"
        log.warning("refused: %s by %s, %d times: %s", refusal.key, who, count, refusal.reason)
        at = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        content = {"key": refusal.key, "kind": refusal.kind, "name": refusal.name, "origin": origin, "count": count}
        line = json.dumps({"time_utc": at, "event": "refused", **content, "reason": refusal.reason})
        try:
            if self._path.exists() and self._path.stat().st_size > MAX_FILE_BYTES:
                self._path.replace(self._path.with_suffix(".previous.jsonl"))
            append_line(self._path, line.encode())
        except OSError:
            self.write_failures += 1  # the line is in the log, and so in the recording
