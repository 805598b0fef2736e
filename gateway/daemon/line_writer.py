"""Output of lines that never waits for its reader."""

import os
import threading

from gateway.daemon.bounded_queue import BoundedQueue

LINES = 1024
WAIT_S = 0.1


class LineWriter(threading.Thread):
    """Writes texts to a descriptor from a thread of its own. A reader that stalls costs texts, which are counted, and no time."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(name=f"output-{descriptor}", daemon=True)
        self._descriptor = descriptor
        self._texts: BoundedQueue[str] = BoundedQueue(LINES)
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
                text = self._texts.get(0.0 if self._finishing.is_set() else WAIT_S)
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
