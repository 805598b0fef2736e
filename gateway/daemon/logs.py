"""The log: to standard error for people and journald, and into the recording as `foxglove.Log`."""

import logging
import sys
from collections.abc import Callable

from gateway.messages import FoxgloveTime, Log

RECORDED_ONLY = {"recorded_only": True}
"""`extra` of a line that a person has been told already in other words."""
LEVELS = {logging.DEBUG: 1, logging.INFO: 2, logging.WARNING: 3, logging.ERROR: 4, logging.CRITICAL: 5}


class RecordingHandler(logging.Handler):
    """Hands each record of the log to the recording."""

    def __init__(self, write: Callable[[Log], None]) -> None:
        super().__init__(logging.INFO)
        self._write = write

    def emit(self, record: logging.LogRecord) -> None:
        """One line of the log."""
        time_ns = round(record.created * 1e9)
        self._write(
            Log(
                timestamp=FoxgloveTime(sec=time_ns // 10**9, nsec=time_ns % 10**9),
                level=LEVELS.get(record.levelno, 2),
                message=record.getMessage(),
                name=record.name,
                file=record.filename,
                line=record.lineno,
            )
        )


def start_logging(level: int = logging.INFO) -> None:
    """Lines to standard error from a level on: level, place, text; the service manager adds the time.

    The recording has those from INFO on, however quiet it is here.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setLevel(level)
    handler.addFilter(lambda record: not getattr(record, "recorded_only", False))
    handler.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    root = logging.getLogger("plumbline")
    root.handlers = [handler]
    root.setLevel(min(level, logging.INFO))
    root.propagate = False
