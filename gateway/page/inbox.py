"""The transfer from Zenoh's threads to the page's one thread: the latest payload of each topic."""

import threading
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Arrival:
    """A payload and the time of its arrival, on the page's monotonic clock."""

    payload: bytes
    at_s: float


class Inbox:
    """Holds the latest payload of each topic, however slow the reader is."""

    def __init__(self, wake: Callable[[], object]) -> None:
        """`wake` is called from any thread, once for each batch that the reader has not drained yet."""
        self._wake = wake
        self._lock = threading.Lock()
        self._latest: dict[str, Arrival] = {}
        self.superseded = 0
        """Number of payloads that were replaced by a newer one of the same topic before they were read."""
        self.refused = 0
        """Number of payloads that were too large."""

    def put(self, topic: str, arrival: Arrival) -> None:
        """Add a payload. Called from Zenoh's threads."""
        with self._lock:
            first = not self._latest
            self.superseded += topic in self._latest
            self._latest[topic] = arrival
        if first:
            self._wake()

    def count_refused(self) -> None:
        """Count a payload that was too large. Called from Zenoh's threads."""
        with self._lock:
            self.refused += 1

    def drain(self) -> dict[str, Arrival]:
        """Return everything that has come since the last call."""
        with self._lock:
            batch, self._latest = self._latest, {}
        return batch
