"""The server of the Foxglove WebSocket protocol: the topics of a recording, live, and one that says whether they still hold."""

import asyncio
import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from foxglove import Channel, Context, Schema, start_server
from foxglove.websocket import StatusLevel, WebSocketServer
from pydantic import ValidationError

from gateway.bridge.foxglove.live_messages import LIVE_TOPICS, LiveMessages
from gateway.bridge.plant_snapshot import PlantSnapshot
from gateway.bridge.plant_state import STATE_CODES, UNHEARD, PlantState
from gateway.bridge.settings import FoxgloveSection, host_and_port
from gateway.errors import InputError
from gateway.messages import Message
from gateway.topics import TOPICS, adapter

log = logging.getLogger("plumbline.foxglove")
STEP_S = 0.02
"""Time between two looks at the queue. Basis: a choice; a picture of a viewer, and little work."""
STATE_INTERVAL_S = 0.5
"""Time between two messages of the state. Basis: a choice; a viewer that joins late waits no longer."""
BACKLOG = 256
"""Messages that wait for one client; the library then drops its oldest. Basis: a choice; some five seconds of a gateway."""
STATUS_ID = "gateway"
STATE_TOPIC = "/bridge"
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


@dataclass(frozen=True, slots=True)
class RecordedForm:
    """How a recording writes messages. It is given to the server: bridges and recordings do not know each other."""

    schema: Callable[[str], bytes]
    encode: Callable[[Message], bytes]


class FoxgloveServer:
    """Passes the messages on, and tells all clients at once when nothing is heard any more."""

    def __init__(
        self,
        section: FoxgloveSection,
        key: str,
        form: RecordedForm,
        snapshot: Callable[[], PlantSnapshot],
        messages: LiveMessages,
    ) -> None:
        self._section, self._key, self._form = section, key, form
        self._snapshot, self._messages = snapshot, messages
        self._context = Context()
        self._channels = {name: self._channel(TOPICS[name].path, form.schema(name)) for name in LIVE_TOPICS}
        self._state_channel = self._channel(STATE_TOPIC, json.dumps(STATE_SCHEMA).encode())
        self._state: PlantState | None = None
        self._stated_s = float("-inf")
        self._invalid = 0

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
        host, port = host_and_port(self._section.listen)
        try:
            return start_server(
                name=self._key, host=host, port=port, context=self._context, message_backlog_size=BACKLOG
            )
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._section.listen} cannot be used ({error}); change foxglove.listen") from error

    def _step(self, server: WebSocketServer, now_s: float) -> None:
        for topic, payload in self._messages.take():
            self._pass_on(topic, payload)
        snapshot = self._snapshot()
        if snapshot.state is not self._state:
            self._announce(server, snapshot.state)
            self._stated_s = float("-inf")
        if now_s - self._stated_s >= STATE_INTERVAL_S:
            self._stated_s = now_s
            self._publish_status(server, snapshot.state)  # again and again, for viewers that join late
            self._state_channel.log(self._encode_state(snapshot))

    def _pass_on(self, topic: str, payload: bytes) -> None:
        """Send a message in its recorded form, which leaves out what is not known."""
        try:
            message: Message = adapter(topic).validate_json(payload)
        except ValidationError:
            self._invalid += 1
        else:
            self._channels[topic].log(self._form.encode(message))

    def _announce(self, server: WebSocketServer, state: PlantState) -> None:
        """Tell the clients the new state. Where nothing is heard any more, they forget what they have: it would look present."""
        if state in UNHEARD and self._state is not None and self._state not in UNHEARD:
            server.clear_session()
        self._state = state
        if state is PlantState.FINE:
            server.remove_status([STATUS_ID])

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
            "invalid": self._invalid,
        }
        if snapshot.age_s is not None:
            content["age_s"] = round(snapshot.age_s, 3)
        return json.dumps(content).encode()
