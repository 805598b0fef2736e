"""A bounded queue between two threads that counts the items that it had to drop."""

import queue
from typing import Generic, TypeVar

Item = TypeVar("Item")


class BoundedQueue(Generic[Item]):
    """A queue of at most `size` items. `put` never waits: into a full queue the new item is dropped and counted."""

    def __init__(self, size: int) -> None:
        self._queue: queue.Queue[Item] = queue.Queue(size)
        self.dropped = 0

    def put(self, item: Item) -> bool:
        """Add an item; return False if it was dropped."""
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1
            return False
        return True

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
