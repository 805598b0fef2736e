"""Supervision of the threads: the watchdog while they run, and their end in a bounded time whatever hangs."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from gateway.daemon.runtime.worker import FaultRegister, Worker
from gateway.service_state import ServiceNotifier

HUNG_S = 8.0
"""Longest usual time of one step of a thread. Basis: a recovery command of a device may take five seconds."""
SLOW_DISK_S = 20.0
"""Longest step of a thread that writes. Basis: an SD card that cleans up has been seen to stop for several seconds."""
STOP_S = 7.0
"""Longest time from a signal to the end of the wait for all threads. Basis: a choice; on a busy computer the samples of some
seconds wait to be processed, and the service has 10 s in all (TimeoutStopSec)."""
THREAD_POLL_S = 0.05
"""Time between two looks for the end. Basis: a choice; not visible to a person, and twenty wakings per second for three
seconds."""


class ProgressingThread(Protocol):
    """A thread that notes when it has last made progress: a sampler, or a worker with or without items."""

    name: str
    """Also the part whose fault the watchdog sets and clears; no thread sets faults of its own under it."""
    progress_s: float

    def is_alive(self) -> bool:
        """Return whether it has been started and has not ended."""
        ...


class Watchdog:
    """Looks at the threads a few times a second. A thread that hangs is named before the service manager restarts the gateway."""

    def __init__(
        self,
        patience_s: Mapping[ProgressingThread, float],
        optional: Sequence[ProgressingThread],
        notifier: ServiceNotifier,
        faults: FaultRegister,
    ) -> None:
        """`patience_s`: the threads without which the gateway is restarted; those of `optional` are reported only."""
        self._patience_s = {**patience_s, **dict.fromkeys(optional, SLOW_DISK_S)}
        self._required = frozenset(patience_s)
        self._notifier = notifier
        self._faults = faults

    def check(self) -> frozenset[ProgressingThread]:
        """Feed the watchdog where all is well; return the threads that hang or have ended."""
        now_s = time.monotonic()
        hung = frozenset(thread for thread in self._patience_s if self._report(thread, now_s))
        if not hung & self._required:
            self._notifier.send("WATCHDOG=1")
        return hung

    def _report(self, thread: ProgressingThread, now_s: float) -> bool:
        patience_s = self._patience_s[thread]
        if not thread.is_alive():
            self._faults.set(thread.name, f"the {thread.name} thread has ended by a defect; restart the gateway")
            return True
        if now_s - thread.progress_s > patience_s:
            self._faults.set(thread.name, f"the {thread.name} thread has made no progress for {patience_s:.0f} s")
            return True
        self._faults.clear(thread.name)
        return False


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
