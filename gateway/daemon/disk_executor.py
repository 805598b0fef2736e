"""The disk for threads that must not wait for it: jobs are carried out one after the other, each with a future."""

import time
from concurrent.futures import Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from gateway.atomic_io import write_durably
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.faults import FaultRegister
from gateway.daemon.worker import Worker
from gateway.disk_job import DiskJob
from gateway.errors import PlumblineError

T = TypeVar("T")
PATIENCE_S = 0.2
"""Longest wait for one job. Basis: an SD card needs 5 to 50 ms, and alerts are due every second."""
INBOX = 64
PART = "state_files"
HANGS = "the disk does not answer"


@dataclass(eq=False, slots=True)
class _Ticket:
    """A job on its way."""

    job: DiskJob[Any]
    future: Future[Any] = field(default_factory=Future)
    abandoned: bool = False


class DiskExecutor(Worker[_Ticket]):
    """Reads and writes calibrations and state files. It must be started before the first job that is waited for."""

    def __init__(self, faults: FaultRegister) -> None:
        super().__init__("state-disk", BoundedQueue(INBOX))
        self._faults = faults
        self._begun_s: float | None = None
        """When the present job began; None: there is none."""

    def perform(self, job: DiskJob[T], /) -> T:
        """Carry a job out within a bounded time; one that takes longer fails and is not finished later.

        While one hangs, others fail at once. Raises what the job raises, and `TimeoutError` where the disk takes too long.
        """
        begun_s = self._begun_s
        if begun_s is not None and time.monotonic() - begun_s > PATIENCE_S:
            raise TimeoutError(HANGS)
        ticket = self._submit(job)
        if not wait([ticket.future], PATIENCE_S).done:
            ticket.abandoned = True
            raise TimeoutError(HANGS)
        found: T = ticket.future.result()
        return found

    def write_soon(self, path: Path, content: bytes) -> None:
        """Replace a file without waiting for it; the old one stays where that fails, which is reported as a fault."""

        def report(done: Future[None]) -> None:
            if (error := done.exception()) is None:
                self._faults.clear(PART)
            else:
                text = error.strerror if isinstance(error, OSError) else None
                self._faults.set(PART, f"{path}: cannot be saved ({text or error})")

        self._submit(lambda _is_wanted: write_durably(path, content)).future.add_done_callback(report)

    def handle(self, item: _Ticket) -> None:
        """Carry out one job."""
        if item.abandoned:
            return
        self._begun_s = time.monotonic()
        try:
            item.future.set_result(item.job(lambda: not item.abandoned))
        except (OSError, PlumblineError) as error:
            item.future.set_exception(error)
        finally:
            self._begun_s = None

    def close(self) -> None:
        """Nothing is open between two jobs."""

    def _submit(self, job: DiskJob[Any]) -> _Ticket:
        ticket = _Ticket(job)
        if not self.inbox.put(ticket):
            ticket.future.set_exception(TimeoutError(HANGS))
        return ticket
