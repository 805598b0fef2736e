"""A bounded queue between two threads, and the thread that handles its items and empties it before it ends."""

import logging
import queue
import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import ClassVar, Generic, TypeVar

Item = TypeVar("Item")
log = logging.getLogger("plumbline.daemon")
END_POLL_S = 0.1
"""Time between two looks for the end. Basis: a choice; an end is not delayed visibly, and ten wakings per second cost nothing."""
DEFECT_LOG_S = 10.0
"""A defect is logged at most this often. Basis: a choice; a defect at each block would fill the log, and a person looks at
minutes."""


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
