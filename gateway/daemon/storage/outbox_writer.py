"""The thread that writes changes of alerts to the disk before they are sent; nobody waits for it longer than a moment."""

import logging
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path

from gateway.daemon.runtime.host import DISK_RETRY_S
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.messages import Alert
from gateway.outbox import (
    MAX_PAGE_BYTES,
    AlertOutbox,
    ChangePage,
    Position,
    StoredChange,
    find_span,
    make_page,
    span_of,
)
from gateway.pipeline.incidents import Incident, unacknowledged_incidents
from gateway.topics import adapter

log = logging.getLogger("plumbline.outbox")
PART = "outbox"
MAX_WAITING_CHANGES = 1024
"""Changes that can wait for a disk that fails; the oldest of more are lost at a power failure, and were sent before. Basis: a
choice; hours of usual changes, and a bound of the memory."""
RECENT_CHANGES = 512
"""Changes in memory, so that a page that starts, or a receiver that has missed a few, gets them without the disk. Basis: a
choice; more than a receiver misses at a restart, and a bound of the memory."""


def _alerts(changes: Iterable[StoredChange]) -> Iterator[Alert]:
    """Yield the messages of changes; one that this version cannot read is left out."""
    for change in changes:
        with suppress(ValueError):
            yield adapter("alert").validate_json(change.payload)


class OutboxWriter(Worker[StoredChange]):
    """Owns the outbox from start to stop."""

    def __init__(self, folder: Path, faults: FaultRegister) -> None:
        super().__init__("outbox-writer", BoundedQueue(MAX_WAITING_CHANGES))
        self._outbox = AlertOutbox(folder)
        self._folder = folder
        self._faults = faults
        self._lock = threading.Lock()
        self._unstored: deque[tuple[StoredChange, Future[bool]]] = deque(maxlen=MAX_WAITING_CHANGES)
        self._recent: deque[StoredChange] = deque(maxlen=RECENT_CHANGES)
        self._opened = threading.Event()
        self._last_number = 0
        self.unacknowledged: tuple[Incident, ...] = ()
        """Incidents of former runs that nobody has acknowledged; known with the last number."""
        self._retry_at_s = 0.0
        self._is_failing = False

    def run(self) -> None:
        """Read the last number, then store until the end."""
        try:
            self._last_number = self._outbox.open()
            self.unacknowledged = tuple(unacknowledged_incidents(_alerts(self._recall())))
        except OSError as error:
            self._fail(error)
        self._opened.set()
        super().run()

    def await_last_number(self, patience_s: float) -> int:
        """Return the number of the last stored change; 0 where there is none, or where it is not known in time."""
        if not self._opened.wait(patience_s):
            log.error("%s: not read within %.0f s; alerts are numbered from 1", self._folder, patience_s)
        return self._last_number

    def recent(self, patience_s: float) -> list[bytes]:
        """Return the last changes as messages, oldest first; waits that long for those from before the start."""
        self._opened.wait(patience_s)
        with self._lock:
            return [change.payload for change in self._recent]

    def submit(self, change: StoredChange) -> Future[bool]:
        """Take a change, and return whether the first attempt has stored it. It never waits. Called by the processing thread."""
        stored: Future[bool] = Future()
        with self._lock:
            self._unstored.append((change, stored))
            self._recent.append(change)
        if not self.inbox.put(change):
            stored.set_result(False)
        return stored

    def page_after(self, position: Position) -> ChangePage:
        """Return the changes behind a position. Raises `OSError`. Called by the thread of the remote calls."""
        with self._lock:
            recent = tuple(self._recent)
            unstored = [change for change, _ in self._unstored]
        if position.boot_id is not None and find_span([span_of(recent)], position) is not None:
            return make_page(recent, position, MAX_PAGE_BYTES, is_known=True)
        return self._outbox.page_after(position, unstored)

    def handle(self, item: StoredChange) -> None:
        """Store everything that waits, with one sync of the disk."""
        self._store()

    def idle(self) -> None:
        """Try again after a failure."""
        if self._is_failing and time.monotonic() >= self._retry_at_s:
            self._store()

    def close(self) -> None:
        """Store what waits, and close the file."""
        self._store()
        self._outbox.close()

    def _recall(self) -> list[StoredChange]:
        """Put the changes from before the start into memory, and return them. Raises `OSError`."""
        stored = self._outbox.newest(RECENT_CHANGES)
        with self._lock:
            self._recent = deque((*stored, *self._recent), maxlen=RECENT_CHANGES)
        return stored

    def _store(self) -> None:
        with self._lock:
            waiting = tuple(self._unstored)
        if not waiting and not self._is_failing:
            return
        try:
            self._outbox.append([change for change, _ in waiting])
        except OSError as error:
            self._fail(error)
        else:
            done = {stored for _, stored in waiting}
            with self._lock:
                self._unstored = deque(
                    (each for each in self._unstored if each[1] not in done), maxlen=MAX_WAITING_CHANGES
                )
            self._is_failing = False
            self._faults.clear(PART)
        for _, stored in waiting:
            if not stored.done():
                stored.set_result(not self._is_failing)

    def _fail(self, error: OSError) -> None:
        self._is_failing = True
        self._faults.set(PART, f"{self._folder}: {error.strerror or error}; alerts are sent without being stored")
        self._retry_at_s = time.monotonic() + DISK_RETRY_S
