"""The log: on standard error for people and journald, and in the recording as `foxglove.Log`. Nobody waits for its reader."""

import logging
import os
import sys
import threading
from collections.abc import Callable

from gateway.daemon.runtime.worker import END_POLL_S, BoundedQueue
from gateway.messages import FoxgloveTime, Log

MAX_WAITING_LINES = 1024
"""Lines that may wait. Basis: a choice; more than a start writes, and a bound of the memory where nobody reads the output."""
RECORDED_ONLY = {"recorded_only": True}
"""`extra` of a line that a person has already read in another form."""
FOXGLOVE_LEVELS = {logging.DEBUG: 1, logging.INFO: 2, logging.WARNING: 3, logging.ERROR: 4, logging.CRITICAL: 5}
"""Definition: the levels of `foxglove.Log`."""


class LineWriter(threading.Thread):
    """Writes texts to a descriptor from a thread of its own. A reader that stalls costs texts, which are counted, and no time."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(name=f"output-{descriptor}", daemon=True)
        self._descriptor = descriptor
        self._texts: BoundedQueue[str] = BoundedQueue(MAX_WAITING_LINES)
        self._reported = 0
        self._finishing = threading.Event()

    @property
    def dropped(self) -> int:
        """Number of texts that were not written."""
        return self._texts.dropped

    def put(self, text: str) -> None:
        """Write a text, of one line or several, soon."""
        self._texts.put(text)

    def finish(self, patience_s: float) -> None:
        """Write what waits and end; give up after a while."""
        self._finishing.set()
        if self.is_alive():
            self.join(patience_s)

    def run(self) -> None:
        """Write until `finish` was called, or the reader has ended."""
        try:
            while True:
                text = self._texts.get(0.0 if self._finishing.is_set() else END_POLL_S)
                if text is not None:
                    self._write(text)
                    self._report_losses()
                elif self._finishing.is_set():
                    return
        except OSError:  # the reader has ended: the queue fills, and the rest is counted
            return

    def _report_losses(self) -> None:
        dropped = self.dropped
        if dropped > self._reported and not len(self._texts):
            self._write(
                f"WARNING plumbline: {dropped - self._reported} lines are missing here; the reader was too slow"
            )
            self._reported = dropped

    def _write(self, text: str) -> None:
        rest = memoryview(f"{text}\n".encode(errors="backslashreplace"))
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]


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
                level=FOXGLOVE_LEVELS.get(record.levelno, 2),
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
