"""A limit on the lines of the log that browsers can cause."""

import logging
import time
from collections.abc import Callable

INTERVAL_S = 10.0
"""Basis: a choice; a person who looks at a fault waits no longer."""
MAX_LINES_PER_INTERVAL = 5
"""Lines in an interval; the first of the next one says how many were left out. Basis: a choice; five show a pattern, and a flood
of requests fills no disk."""


class LogRateLimiter(logging.Filter):
    """Passes `MAX_LINES_PER_INTERVAL` lines in each interval and counts the others."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now_s = now_s
        self._begin_s = now_s()
        self._lines = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is written."""
        now_s = self._now_s()
        if now_s - self._begin_s >= INTERVAL_S:
            left_out = max(self._lines - MAX_LINES_PER_INTERVAL, 0)
            self._begin_s, self._lines = now_s, 0
            if left_out:
                record.msg, record.args = f"{record.getMessage()} ({left_out} lines were left out)", ()
        self._lines += 1
        return self._lines <= MAX_LINES_PER_INTERVAL
