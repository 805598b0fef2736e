"""A bounded queue between two threads that counts the items that it had to drop."""

import queue
import threading
from contextlib import suppress
from typing import Generic, TypeVar

Item = TypeVar("Item")


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
