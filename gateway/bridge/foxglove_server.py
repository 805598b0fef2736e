"""The server of the Foxglove WebSocket protocol, by which viewers look at a gateway: the topics of recordings, live or played.

It says whether they hold. Live messages are shown each as it comes: the other bridges need the newest of each topic only.
"""

import asyncio
import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from foxglove import Channel, Context, Schema, start_server
from foxglove.websocket import Capability, ChannelView, Client, ServerListener, StatusLevel, WebSocketServer
from pydantic import ValidationError

from gateway.bridge.plant_snapshot import STATE_CODES, UNHEARD, PlantSnapshot, PlantState
from gateway.bridge.settings import FoxgloveSection
from gateway.bus.authenticity import Doubt
from gateway.bus.fleet_inbox import LARGEST_STATE_BYTES, FleetInbox
from gateway.configuration.section import host_and_port
from gateway.errors import InputError
from gateway.messages import Message
from gateway.topics import TOPICS, adapter

STEP_S = 0.02
"""Time between two looks at the queue. Basis: a choice; a picture of a viewer, and little work."""
STATE_INTERVAL_S = 0.5
"""Time between two messages of the state. Basis: a choice; a viewer that joins late waits no longer."""
BACKLOG = 256
"""Messages that wait for one client; the library then drops its oldest. Basis: a choice; some five seconds of a gateway."""
STATUS_ID = "gateway"
STATE = "bridge"
STATE_SCHEMA = {
    "title": "plumbline.Bridge",
    "type": "object",
    "properties": {
        "state": {"type": "string", "enum": [str(state) for state in STATE_CODES]},
        "meaning": {"type": "string", "description": "of the state"},
        "age_s": {"type": "number", "description": "since the newest reading arrived; left out before the first one"},
        "dropped": {"type": "integer", "description": "messages that the bridge itself had no room for"},
        "invalid": {"type": "integer", "description": "messages that are not valid by the schema of their topic"},
    },
    "required": ["state", "meaning", "dropped", "invalid"],
}
STATE_CHANNEL = f"/{STATE}", json.dumps(STATE_SCHEMA).encode()
LIVE_TOPICS = tuple(topic.name for topic in TOPICS.values() if topic.published)
"""What a gateway publishes. A recording has more: see `gateway.topics`."""
MOST_WAITING = 512
"""Messages that may wait. Basis: a choice; some ten seconds of a gateway, and at most 32 MB."""


class MessageSource(Protocol):
    """What viewers are shown: a gateway, live, or a recording."""

    topics: tuple[str, ...]
    has_own_clock: bool
    """Whether viewers shall count the time of the messages in place of their own."""
    dropped: int
    """Messages that it had no room for."""
    invalid: int
    """Messages that are not valid by the schema of their topic."""

    def take(self) -> Sequence[tuple[str, bytes, int | None]]:
        """Return topic, content in its recorded form and time, ns, of the messages that are due; None: they are of now."""


class Viewers(ServerListener):
    """Counts what is looked at. Called from the library's threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.subscriptions = 0
        """Topics that a viewer gets, over all viewers."""

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Count one more."""
        with self._lock:
            self.subscriptions += 1

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Count one less; called for each topic of a viewer that leaves."""
        with self._lock:
            self.subscriptions -= 1


class FoxgloveServer:
    """Passes the messages on, and tells all clients at once when nothing is heard any more."""

    def __init__(
        self,
        section: FoxgloveSection,
        key: str,
        schema: Callable[[str], bytes],
        snapshot: Callable[[], PlantSnapshot],
        messages: MessageSource,
    ) -> None:
        """`schema`: of a topic in recordings. It is given: bridges and recordings do not know each other."""
        self._section, self._key = section, key
        self._snapshot, self._messages = snapshot, messages
        self.viewers = Viewers()
        self._context = Context()
        self._channels = {name: self._channel(TOPICS[name].path, schema(name)) for name in messages.topics}
        self._channels[STATE] = self._channel(*STATE_CHANNEL)
        self._state: PlantState | None = None
        self._stated_s = float("-inf")
        self._newest_ns = 0

    def _channel(self, path: str, schema: bytes) -> Channel:
        name = str(json.loads(schema)["title"])
        described = Schema(name=name, encoding="jsonschema", data=schema)
        return Channel(path, schema=described, message_encoding="json", context=self._context)

    async def serve(self, started: Callable[[], None]) -> None:
        """Serve until cancelled; `started` is called when clients can connect. Raises `InputError`.

        The end of the process closes the connections: `server.stop` would wait for a stalled client.
        """
        server = self._listen()
        started()
        while True:
            self._step(server, time.monotonic())
            await asyncio.sleep(STEP_S)

    def _listen(self) -> WebSocketServer:
        # The library logs an error for each message that a viewer did not wait for.
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        host, port = host_and_port(self._section.listen)
        try:
            return start_server(
                name=self._key,
                host=host,
                port=port,
                capabilities=[Capability.Time] if self._messages.has_own_clock else [],
                server_listener=self.viewers,
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._section.listen} cannot be used ({error}); change foxglove.listen") from error

    def _step(self, server: WebSocketServer, now_s: float) -> None:
        for topic, content, time_ns in self._messages.take():
            if time_ns is not None and time_ns > self._newest_ns:  # a time before it would make viewers start anew
                self._newest_ns = time_ns
                server.broadcast_time(time_ns)
            self._channels[topic].log(content, log_time=time_ns)
        snapshot = self._snapshot()
        if snapshot.state is not self._state:
            self._announce(server, snapshot.state)
            self._stated_s = float("-inf")
        if now_s - self._stated_s >= STATE_INTERVAL_S:
            self._stated_s = now_s
            self._publish_status(server, snapshot.state)  # again and again, for viewers that join late
            self._channels[STATE].log(self._encode_state(snapshot))

    def _announce(self, server: WebSocketServer, state: PlantState) -> None:
        """Tell the clients the new state. Where nothing is heard any more, they forget what they have: it would look present."""
        if self._state is not None and (state in UNHEARD) != (self._state in UNHEARD):
            self._begin_session(server)
        self._state = state
        if state is PlantState.FINE:
            server.remove_status([STATUS_ID])

    def _begin_session(self, server: WebSocketServer) -> None:
        """Let the clients begin anew. Lichtblick looks at the schemas again when any topic is advertised anew.

        One, because the library keeps each channel for ever.
        """
        server.clear_session()
        self._channels[STATE].close()
        self._channels[STATE] = self._channel(*STATE_CHANNEL)

    @staticmethod
    def _publish_status(server: WebSocketServer, state: PlantState) -> None:
        if state is not PlantState.FINE:
            level = StatusLevel.Error if state in UNHEARD else StatusLevel.Warning
            server.publish_status(f"{state}: {STATE_CODES[state].meaning}", level, STATUS_ID)

    def _encode_state(self, snapshot: PlantSnapshot) -> bytes:
        content: dict[str, object] = {
            "state": str(snapshot.state),
            "meaning": STATE_CODES[snapshot.state].meaning,
            "dropped": self._messages.dropped,
            "invalid": self._messages.invalid,
        }
        if snapshot.age_s is not None:
            content["age_s"] = round(snapshot.age_s, 3)
        return json.dumps(content).encode()


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
