"""The watchdog of the service manager: it is fed only while every thread that monitors, records and publishes makes progress."""

import time
from collections.abc import Mapping, Sequence
from typing import Protocol

from gateway.daemon.runtime.faults import FaultRegister
from gateway.service_state import ServiceNotifier

HUNG_S = 8.0
"""Longest usual time of one step of a thread. Basis: a recovery command of a device may take five seconds."""
SLOW_DISK_S = 20.0
"""Longest step of a thread that writes. Basis: an SD card that cleans up has been seen to stop for several seconds."""


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
