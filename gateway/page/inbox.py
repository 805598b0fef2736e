"""Hand-over from Zenoh's threads to the page's one thread: the latest arrival of each topic, no more."""

import threading
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Arrival:
    """A payload and when it came, on the page's monotonic clock."""

    payload: bytes
    at_s: float


class Inbox:
    """Bounded by the number of topics, however slow the reader is."""

    def __init__(self, wake: Callable[[], object]) -> None:
        """`wake` is called from any thread, once for each batch that the reader has not taken yet."""
        self._wake = wake
        self._lock = threading.Lock()
        self._latest: dict[str, Arrival] = {}
        self.superseded = 0
        """Arrivals that a newer one of the same topic replaced before they were read."""
        self.refused = 0
        """Arrivals too large to be handed over."""

    def put(self, topic: str, arrival: Arrival) -> None:
        """Called from Zenoh's threads."""
        with self._lock:
            first = not self._latest
            self.superseded += topic in self._latest
            self._latest[topic] = arrival
        if first:
            self._wake()

    def refuse(self) -> None:
        """Count an arrival that is not handed over; called from Zenoh's threads."""
        with self._lock:
            self.refused += 1

    def take(self) -> dict[str, Arrival]:
        """All that came since the last call."""
        with self._lock:
            batch, self._latest = self._latest, {}
        return batch
