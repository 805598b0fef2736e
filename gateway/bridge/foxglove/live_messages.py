"""Every message of a gateway as it comes, in a bounded queue: the other bridges need the newest of each topic only."""

import threading
from collections import deque
from collections.abc import Callable

from pydantic import ValidationError

from gateway.bus.authenticity import Doubt
from gateway.bus.fleet_inbox import LARGEST_STATE_BYTES, FleetInbox
from gateway.messages import Message
from gateway.topics import TOPICS, adapter

LIVE_TOPICS = tuple(topic.name for topic in TOPICS.values() if topic.published)
"""What a gateway publishes. A recording has more: see `gateway.topics`."""
MOST_WAITING = 512
"""Messages that may wait. Basis: a choice; some ten seconds of a gateway, and at most 32 MB."""


class LiveMessages(FleetInbox):
    """Keeps live messages in their order until they are taken; the oldest is dropped, and counted, where nobody takes them."""

    topics = LIVE_TOPICS
    has_own_clock = False

    def __init__(self, encode: Callable[[Message], bytes]) -> None:
        """`encode`: how a recording writes messages. It is given: bridges and recordings do not know each other."""
        super().__init__()
        self._encode = encode
        self._waiting: deque[tuple[str, bytes]] = deque(maxlen=MOST_WAITING)
        self._queue_lock = threading.Lock()
        self.dropped = self.invalid = 0

    def put(self, key_expression: str, payload: bytes, at_s: float, *, live: bool, doubt: Doubt | None = None) -> None:
        """Add a payload under `<gateway>/<topic>`. Called from Zenoh's threads.

        Of a gateway whose key is known nothing else is shown; of one that has none everything is, and the state says so.
        """
        super().put(key_expression, payload, at_s, live=live, doubt=doubt)
        is_own = doubt is None or doubt.kind == "unsigned"
        if live and is_own and len(payload) <= LARGEST_STATE_BYTES:
            with self._queue_lock:
                self.dropped += len(self._waiting) == MOST_WAITING
                self._waiting.append((key_expression.rpartition("/")[2], payload))

    def take(self) -> list[tuple[str, bytes, None]]:
        """Return the messages that wait, in their recorded form, which leaves out what is not known."""
        with self._queue_lock:
            waiting = list(self._waiting)
            self._waiting.clear()
        taken = []
        for topic, payload in waiting:
            try:
                message: Message = adapter(topic).validate_json(payload)
            except ValidationError:
                self.invalid += 1
            else:
                taken.append((topic, self._encode(message), None))
        return taken
