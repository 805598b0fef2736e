"""The log: on standard error for people and journald, and in the recording as `foxglove.Log`."""

import logging
import sys
from collections.abc import Callable

from gateway.daemon.line_writer import LineWriter
from gateway.messages import FoxgloveTime, Log

RECORDED_ONLY = {"recorded_only": True}
"""`extra` of a line that a person has already read in another form."""
LEVELS = {logging.DEBUG: 1, logging.INFO: 2, logging.WARNING: 3, logging.ERROR: 4, logging.CRITICAL: 5}


class RecordingHandler(logging.Handler):
    """Passes each line of the log to the recording."""

    def __init__(self, write: Callable[[Log], None]) -> None:
        super().__init__(logging.INFO)
        self._write = write

    def emit(self, record: logging.LogRecord) -> None:
        """Pass one line on."""
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


class LineHandler(logging.Handler):
    """Passes each line of the log to a writer, which never lets the calling thread wait."""

    def __init__(self, writer: LineWriter, level: int) -> None:
        super().__init__(level)
        self._writer = writer
        self.addFilter(lambda record: not getattr(record, "recorded_only", False))
        self.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        """Pass one line on."""
        self._writer.put(self.format(record))


def start_logging(level: int = logging.INFO) -> LineWriter:
    """Write lines of a level and above to standard error, with level, name and text; the service manager adds the time.

    The recording contains all lines from INFO on, whatever `level` is. The returned writer is running.
    """
    writer = LineWriter(sys.stderr.fileno())
    writer.start()
    root = logging.getLogger("plumbline")
    root.handlers = [LineHandler(writer, level)]
    root.setLevel(min(level, logging.INFO))
    root.propagate = False
    return writer
