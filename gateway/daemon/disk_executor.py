"""The disk for a thread that must not wait for it: a job that takes too long fails, and is not carried out later."""

import threading
from dataclasses import dataclass, field

from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.worker import Worker
from gateway.disk_job import DiskJob
from gateway.errors import PlumblineError

PATIENCE_S = 0.2
"""Longest wait for one job. Basis: an SD card needs 5 to 50 ms, and alerts are due every second."""
INBOX = 4


@dataclass(eq=False, slots=True)
class _Ticket:
    """A job on its way."""

    job: DiskJob
    done: threading.Event = field(default_factory=threading.Event)
    error: OSError | PlumblineError | None = None
    abandoned: bool = False


class BoundedDisk(Worker[_Ticket]):
    """Carries out the jobs one after the other. While one hangs, others fail at once. It must be started before the first job."""

    def __init__(self) -> None:
        super().__init__("calibration-disk", BoundedQueue(INBOX))
        self._hanging = threading.Event()

    def perform(self, job: DiskJob) -> None:
        """Carry a job out within a bounded time. Raises what the job raises, `TimeoutError` where the disk takes too long."""
        ticket = _Ticket(job)
        if self._hanging.is_set() or not self.inbox.put(ticket):
            raise TimeoutError("the disk does not answer")
        if not ticket.done.wait(PATIENCE_S):
            ticket.abandoned = True
            self._hanging.set()
            raise TimeoutError("the disk does not answer")
        if ticket.error is not None:
            raise ticket.error

    def handle(self, item: _Ticket) -> None:
        """Carry out one job."""
        if not item.abandoned:
            try:
                item.job(lambda: not item.abandoned)
            except (OSError, PlumblineError) as error:
                item.error = error
        self._hanging.clear()
        item.done.set()

    def close(self) -> None:
        """Nothing is open between two jobs."""
