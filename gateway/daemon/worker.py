"""A thread that handles the items of a bounded queue, and empties the queue before it ends."""

import threading
from abc import abstractmethod
from typing import Generic, TypeVar

from gateway.daemon.bounded_queue import BoundedQueue

Item = TypeVar("Item")
WAIT_S = 0.1


class Worker(threading.Thread, Generic[Item]):
    """Base of the threads that process, record, publish and answer remote calls."""

    def __init__(self, name: str, inbox: BoundedQueue[Item]) -> None:
        super().__init__(name=name, daemon=True)
        self.inbox = inbox
        self._finishing = threading.Event()

    def finish(self) -> None:
        """Ask the thread to handle what is in the inbox and then end."""
        self._finishing.set()

    def run(self) -> None:
        """Work until `finish` was called and the inbox is empty."""
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
        """Handle one item of the inbox."""

    def idle(self) -> None:
        """Called while no item comes."""

    @abstractmethod
    def close(self) -> None:
        """Release what the thread owns."""
