"""A thread that handles the items of a bounded queue, and empties the queue before it ends."""

import logging
import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, Generic, TypeVar

from gateway.daemon.runtime.bounded_queue import BoundedQueue

log = logging.getLogger("plumbline.daemon")
Item = TypeVar("Item")
END_POLL_S = 0.1
"""Time between two looks for the end. Basis: a choice; an end is not delayed visibly, and ten wakings per second cost nothing."""
DEFECT_LOG_S = 10.0
"""A defect is logged at most this often. Basis: a choice; a defect at each block would fill the log, and a person looks at
minutes."""


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
