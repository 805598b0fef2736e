"""The transfer from Zenoh's threads to one reader: the latest payload of every topic of every gateway."""

import threading
from dataclasses import dataclass, field

from gateway.bus.authenticity import Doubt, newer_doubt
from gateway.bus.untrusted import MOST_GATEWAYS, is_gateway_key

LARGEST_STATE_BYTES = 65536
"""Largest message of a fleet, bytes. Basis: alerts, health and conditions have a few kilobytes."""


@dataclass(frozen=True, slots=True)
class FleetArrival:
    """A payload, the time of its arrival on the monotonic clock, and whether it was published just then."""

    payload: bytes
    at_s: float
    live: bool
    """False: an older message, from a status answer or a storage."""
    doubt: Doubt | None = None
    """Why it is not authenticated; None: it is."""


@dataclass(frozen=True, slots=True)
class FleetBatch:
    """Everything that has come since the last batch."""

    arrivals: dict[tuple[str, str], FleetArrival] = field(default_factory=dict)
    """By gateway and topic."""
    alive: dict[str, bool] = field(default_factory=dict)
    """Changes of the liveliness tokens, by gateway."""
    doubts: dict[str, tuple[Doubt, float]] = field(default_factory=dict)
    """The last doubt about a message, and when it came, by gateway."""


class FleetInbox:
    """Holds the latest payloads, however slow the reader is."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._batch = FleetBatch()
        self._keys: set[str] = set()
        self.refused = 0
        """Number of payloads that were too large, or under a name that no configuration allows."""

    def put(self, key_expression: str, payload: bytes, at_s: float, *, live: bool, doubt: Doubt | None = None) -> None:
        """Add a payload under `<gateway>/<topic>`. An older message never replaces a live one, nor a doubtful one another."""
        key, _, topic = key_expression.rpartition("/")
        with self._lock:
            if len(payload) > LARGEST_STATE_BYTES or not self._admit(key):
                self.refused += 1
                return
            if doubt is not None:
                self._batch.doubts[key] = newer_doubt(self._batch.doubts.get(key), doubt, at_s)
            before = self._batch.arrivals.get((key, topic))
            if before is None or _rank(live, doubt) >= _rank(before.live, before.doubt):
                self._batch.arrivals[key, topic] = FleetArrival(payload, at_s, live, doubt)

    def put_alive(self, key_expression: str, alive: bool) -> None:
        """Add a change of a liveliness token, `<gateway>/alive`."""
        key, _, _ = key_expression.rpartition("/")
        with self._lock:
            if self._admit(key):
                self._batch.alive[key] = alive
            else:
                self.refused += 1

    def count_refused(self) -> None:
        """Count a payload that was not usable. Called from Zenoh's threads."""
        with self._lock:
            self.refused += 1

    def drain(self) -> FleetBatch:
        """Return everything that has come since the last call."""
        with self._lock:
            batch, self._batch = self._batch, FleetBatch()
        return batch

    def _admit(self, key: str) -> bool:
        if key in self._keys:
            return True
        if len(self._keys) >= MOST_GATEWAYS or not is_gateway_key(key):
            return False
        self._keys.add(key)
        return True


def _rank(live: bool, doubt: Doubt | None) -> tuple[bool, bool]:
    return doubt is None, live
