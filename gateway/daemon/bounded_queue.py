"""A bounded queue between two threads that counts what it had to drop."""

import queue
from typing import Generic, TypeVar

Item = TypeVar("Item")


class BoundedQueue(Generic[Item]):
    """`put` never waits: when the reader has fallen behind by `size` items, the newest is dropped and counted."""

    def __init__(self, size: int) -> None:
        self._queue: queue.Queue[Item] = queue.Queue(size)
        self.dropped = 0

    def put(self, item: Item) -> bool:
        """Hand an item on; False when it was dropped."""
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1
            return False
        return True

    def put_waiting(self, item: Item, timeout_s: float) -> bool:
        """Hand an item on, waiting for the reader; for sources that can wait. False when there was no room in time."""
        try:
            self._queue.put(item, timeout=timeout_s)
        except queue.Full:
            return False
        return True

    def get(self, timeout_s: float) -> Item | None:
        """The oldest item, or None when none came in time."""
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def __len__(self) -> int:
        return self._queue.qsize()
