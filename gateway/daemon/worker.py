"""A thread that lives off a bounded inbox: handles what comes, is told the time in between, and drains before it leaves."""

import logging
import threading
from abc import abstractmethod
from typing import Generic, TypeVar

from gateway.daemon.bounded_queue import BoundedQueue

Item = TypeVar("Item")
WAIT_S = 0.1
log = logging.getLogger("plumbline")


class Worker(threading.Thread, Generic[Item]):
    """Base of the processing, recording and publishing threads."""

    def __init__(self, name: str, size: int) -> None:
        super().__init__(name=name, daemon=True)
        self.inbox: BoundedQueue[Item] = BoundedQueue(size)
        self._finishing = threading.Event()

    def finish(self) -> None:
        """Handle what is in the inbox, then leave."""
        self._finishing.set()

    def run(self) -> None:
        """Work until told to finish and the inbox is empty."""
        try:
            while True:
                item = self.inbox.get(0.0 if self._finishing.is_set() else WAIT_S)
                if item is not None:
                    self.handle(item)
                elif self._finishing.is_set():
                    break
                else:
                    self.idle()
        finally:
            self.close()

    @abstractmethod
    def handle(self, item: Item) -> None:
        """One item of the inbox."""

    def idle(self) -> None:
        """Nothing came for a moment."""

    @abstractmethod
    def close(self) -> None:
        """Release what the thread owns."""
