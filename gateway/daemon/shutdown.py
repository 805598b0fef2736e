"""The end of the threads, in a bounded time whatever hangs."""

import threading
import time

STOP_S = 3.0
"""Longest time from a signal to the end of the wait for all threads."""
LOOK_S = 0.05


class Shutdown:
    """Waits for threads: for each as long as it needs, and after a signal for all together no longer than `STOP_S`."""

    def __init__(self, signalled: threading.Event) -> None:
        self._signalled = signalled
        self._end_s: float | None = None
        self.stuck: list[str] = []
        """Names of the threads that did not end in time."""

    def join(self, thread: threading.Thread, patience_s: float) -> None:
        """Wait for a thread; a signal that comes meanwhile shortens the wait."""
        end_s = time.monotonic() + patience_s
        while thread.is_alive() and time.monotonic() < min(end_s, self._deadline_s()):
            thread.join(LOOK_S)
        if thread.is_alive():
            self.stuck.append(thread.name)

    def _deadline_s(self) -> float:
        if self._end_s is None and self._signalled.is_set():
            self._end_s = time.monotonic() + STOP_S
        return float("inf") if self._end_s is None else self._end_s
