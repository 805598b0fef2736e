"""A bounded queue between two threads, the thread that handles its items and empties it before it ends, and the faults of parts.

A fault is what does not work at present: one line for each part, how often it has failed, and the pauses between attempts.
"""

import logging
import queue
import threading
import time
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from typing import ClassVar, Generic, TypeVar

fault_log = logging.getLogger("plumbline.fault")
RETRYING = "retrying; other functions are not affected"
"""End of the text of a part that is started again until it works."""
Item = TypeVar("Item")
log = logging.getLogger("plumbline.daemon")
END_POLL_S = 0.1
"""Time between two looks for the end. Basis: a choice; an end is not delayed visibly, and ten wakings per second cost nothing."""
DEFECT_LOG_S = 10.0
"""A defect is logged at most this often. Basis: a choice; a defect at each block would fill the log, and a person looks at
minutes."""


class FaultRegister:
    """The faults of the parts around the monitoring. Used by any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._standing: dict[str, str] = {}
        self._counts: Counter[str] = Counter()

    def set(self, part: str, text: str) -> None:
        """Note that a part does not work; a text that is new is also logged."""
        with self._lock:
            before = self._standing.get(part)
            self._standing[part] = text
            if before is None:
                self._counts[part] += 1
        if text != before:
            fault_log.error("%s", text)

    def clear(self, part: str) -> None:
        """Note that a part works."""
        with self._lock:
            was_standing = self._standing.pop(part, None) is not None
        if was_standing:
            fault_log.warning("%s: works again", part)

    @property
    def standing(self) -> dict[str, str]:
        """The parts that do not work, with the reason."""
        with self._lock:
            return dict(self._standing)

    @property
    def counts(self) -> dict[str, int]:
        """How often each part has stopped working, as `<part>_failures`."""
        with self._lock:
            return {f"{part}_failures": count for part, count in self._counts.items()}


class Backoff:
    """The pause before the next attempt."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self.pause_s = first_s
        self._longest_s = longest_s

    def increase(self) -> None:
        """Double the pause, up to the limit."""
        self.pause_s = min(2 * self.pause_s, self._longest_s)


class BoundedQueue(Generic[Item]):
    """A queue of at most `size` items. `put` never waits: into a full queue the new item is dropped and counted."""

    def __init__(self, size: int) -> None:
        self.size = size
        self._queue: queue.Queue[Item] = queue.Queue(size)
        self._lock = threading.Lock()
        self.dropped = 0

    def put(self, item: Item, reserved: int = 0) -> bool:
        """Add an item, but not to the last `reserved` places; return False if it was dropped. Called by any thread."""
        if self._queue.qsize() + reserved < self.size:
            with suppress(queue.Full):
                self._queue.put_nowait(item)
                return True
        with self._lock:
            self.dropped += 1
        return False

    def put_waiting(self, item: Item, timeout_s: float) -> bool:
        """Add an item as soon as there is room, for sources that can wait; return False if there was none in time."""
        try:
            self._queue.put(item, timeout=timeout_s)
        except queue.Full:
            return False
        return True

    def get(self, timeout_s: float) -> Item | None:
        """Remove and return the oldest item; None if none came in time."""
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def __len__(self) -> int:
        return self._queue.qsize()


class Worker(threading.Thread, Generic[Item]):
    """Base of the threads that process, record, publish and answer remote calls."""

    is_essential: ClassVar[bool] = False
    """Whether the gateway cannot go on without this thread: a defect then ends it, and the service manager restarts it."""

    def __init__(self, name: str, inbox: BoundedQueue[Item]) -> None:
        super().__init__(name=name, daemon=True)
        self.inbox = inbox
        self.defects = 0
        """Number of items that could not be handled because of a defect in the program."""
        self.progress_s = time.monotonic()
        """When the thread last began a step; one with an empty inbox makes progress too."""
        self._defect_logged_s = -DEFECT_LOG_S
        self._finishing = threading.Event()

    def finish(self) -> None:
        """Ask the thread to handle what is in the inbox and then end."""
        self._finishing.set()

    def run(self) -> None:
        """Work until `finish` was called and the inbox is empty."""
        try:
            while True:
                self.progress_s = time.monotonic()
                item = self.inbox.get(0.0 if self._finishing.is_set() else END_POLL_S)
                if item is not None:
                    self._attempt(lambda item=item: self.handle(item))  # type: ignore[misc]
                elif self._finishing.is_set():
                    break
                else:
                    self._attempt(self.idle)
        finally:
            self.close()

    def _attempt(self, step: Callable[[], None]) -> None:
        """Do one step. A defect of a part that the monitoring can do without is logged and counted, and costs the item."""
        if self.is_essential:
            step()
            return
        try:
            step()
        except Exception as error:  # sampling and alerts go on whatever a sink does
            self.defects += 1
            now_s = time.monotonic()
            if now_s - self._defect_logged_s >= DEFECT_LOG_S:
                self._defect_logged_s = now_s
                log.exception("defect in the %s thread, number %d", self.name, self.defects)
            self.recover(error)

    @abstractmethod
    def handle(self, item: Item) -> None:
        """Handle one item of the inbox."""

    def idle(self) -> None:
        """Called while no item comes."""

    def recover(self, defect: Exception) -> None:
        """Called after a defect, to continue from a known state."""

    @abstractmethod
    def close(self) -> None:
        """Release what the thread owns."""
