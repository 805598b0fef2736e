"""Every message of a gateway as it comes, in a bounded queue: the other bridges need the newest of each topic only."""

import threading
from collections import deque

from gateway.bus.authenticity import Doubt
from gateway.bus.fleet_inbox import LARGEST_PAYLOAD, FleetInbox
from gateway.topics import TOPICS

LIVE_TOPICS = tuple(topic.name for topic in TOPICS.values() if topic.published)
"""What a gateway publishes. A recording has more: see `gateway.topics`."""
MOST_WAITING = 512
"""Messages that may wait. Basis: a choice; some ten seconds of a gateway, and at most 32 MB."""


class LiveMessages(FleetInbox):
    """Keeps live messages in their order until they are taken; the oldest is dropped, and counted, where nobody takes them."""

    def __init__(self) -> None:
        super().__init__()
        self._waiting: deque[tuple[str, bytes]] = deque(maxlen=MOST_WAITING)
        self._queue_lock = threading.Lock()
        self.dropped = 0

    def put(self, key_expression: str, payload: bytes, at_s: float, *, live: bool, doubt: Doubt | None = None) -> None:
        """Add a payload under `<gateway>/<topic>`. Called from Zenoh's threads.

        Of a gateway whose key is known nothing else is shown; of one that has none everything is, and the state says so.
        """
        super().put(key_expression, payload, at_s, live=live, doubt=doubt)
        is_own = doubt is None or doubt.kind == "unsigned"
        if live and is_own and len(payload) <= LARGEST_PAYLOAD:
            with self._queue_lock:
                self.dropped += len(self._waiting) == MOST_WAITING
                self._waiting.append((key_expression.rpartition("/")[2], payload))

    def take(self) -> list[tuple[str, bytes]]:
        """Return topic and payload of the messages that wait."""
        with self._queue_lock:
            waiting = list(self._waiting)
            self._waiting.clear()
        return waiting
