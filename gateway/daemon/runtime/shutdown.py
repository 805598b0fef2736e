"""The end of the threads, in a bounded time whatever hangs."""

import threading
import time
from collections.abc import Callable
from typing import Any

from gateway.daemon.runtime.worker import Worker

STOP_S = 7.0
"""Longest time from a signal to the end of the wait for all threads. Basis: a choice; on a busy computer the samples of some
seconds wait to be processed, and the service has 10 s in all (TimeoutStopSec)."""
THREAD_POLL_S = 0.05
"""Time between two looks for the end. Basis: a choice; not visible to a person, and twenty wakings per second for three
seconds."""


class Shutdown:
    """Waits for threads; after a signal for all together no longer than `STOP_S`."""

    def __init__(self, signalled: threading.Event) -> None:
        self._signalled = signalled
        self._signalled_s: float | None = None
        self.stuck: list[str] = []
        """Names of the threads that did not end in time."""

    def join(self, thread: threading.Thread, patience_s: float) -> None:
        """Wait for a thread; a signal that comes meanwhile shortens the wait."""
        end_s = time.monotonic() + patience_s
        self._wait(thread, lambda: end_s)

    def drain(self, worker: Worker[Any], patience_s: float, hurried_s: float, kept_s: float = 0.0) -> None:
        """Wait while a thread works off its queue, for each step so long as `patience_s`.

        After a signal for each step `hurried_s`, and so that `kept_s` of `STOP_S` is left to the threads after it.
        """
        begun_s = time.monotonic()

        def end_s() -> float:
            step_s = max(begun_s, worker.progress_s)
            if self._signalled_s is None:
                return step_s + patience_s
            return min(max(step_s, self._signalled_s) + hurried_s, self._signalled_s + STOP_S - kept_s)

        self._wait(worker, end_s)

    def _wait(self, thread: threading.Thread, end_s: Callable[[], float]) -> None:
        while thread.is_alive() and time.monotonic() < min(self._deadline_s(), end_s()):
            thread.join(THREAD_POLL_S)
        if thread.is_alive():
            self.stuck.append(thread.name)

    def _deadline_s(self) -> float:
        if self._signalled_s is None and self._signalled.is_set():
            self._signalled_s = time.monotonic()
        return float("inf") if self._signalled_s is None else self._signalled_s + STOP_S
