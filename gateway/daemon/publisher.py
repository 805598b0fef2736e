"""The publishing thread: puts messages on the bus and answers queries. The sampling thread never waits for a peer."""

import json
import logging
from dataclasses import dataclass
from functools import partial

import zenoh
from pydantic_core import to_json

from gateway.daemon.recalibration_service import PendingRequest, RecalibrationService
from gateway.daemon.worker import Worker
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recalibration.journal import Answer
from gateway.recalibration.requests import LARGEST_PAYLOAD, VERBS
from gateway.topics import TOPICS, encode

log = logging.getLogger("plumbline.bus")
INBOX = 2048
STATUS_TOPICS = tuple(name for name, topic in TOPICS.items() if topic.published and name != "samples")
JSON = zenoh.Encoding.APPLICATION_JSON


@dataclass(frozen=True, slots=True)
class Query:
    """A query that came, with the verb that it came for."""

    verb: str
    query: zenoh.Query


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer on its way out."""

    query: Query
    answer: Answer


@dataclass(frozen=True, slots=True)
class Load:
    """What the crane's load signal put on the bus."""

    sample: zenoh.Sample


class Publisher(Worker[OutgoingMessage | Query | Reply | Load]):
    """Owns the bus session from start to stop."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        super().__init__("publisher", INBOX)
        self._session = session
        self._key = key
        self._latest: dict[str, bytes] = {}
        self._publishers = {
            name: session.declare_publisher(
                f"{key}/{name}",
                encoding=JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.REAL_TIME if name == "alert" else zenoh.Priority.DATA,
                express=name == "alert",  # an alert is not held back for a batch
            )
            for name, topic in TOPICS.items()
            if topic.published
        }
        # The bus may not be called from its callbacks: what comes joins the inbox and is answered by this thread.
        self._queryables = [self._queryable("status")]
        self._load: zenoh.Subscriber[None] | None = None
        self._desk: RecalibrationService | None = None
        self._alive = session.liveliness().declare_token(f"{key}/alive")

    def serve(self, desk: RecalibrationService) -> None:
        """Take requests for the recalibration, and the load signal; to be called before the thread starts."""
        self._desk = desk
        self._queryables += [self._queryable(verb) for verb in (*VERBS, "fetch")]
        self._load = self._session.declare_subscriber(f"{self._key}/load", lambda sample: self.inbox.put(Load(sample)))

    def _queryable(self, verb: str) -> zenoh.Queryable[None]:
        return self._session.declare_queryable(f"{self._key}/rpc/{verb}", partial(self._receive, verb))

    def _receive(self, verb: str, query: zenoh.Query) -> None:
        self.inbox.put(Query(verb, query))

    def handle(self, item: OutgoingMessage | Query | Reply | Load) -> None:
        """Put a message, take a query, or answer one."""
        match item:
            case OutgoingMessage():
                self._publish(item)
            case Query():
                self._take(item)
            case Reply():
                self._answer(item.query, item.answer)
            case Load() if self._desk is not None and len(item.sample.payload) <= LARGEST_PAYLOAD:
                self._desk.set_load_signal(item.sample.payload.to_bytes())

    def _publish(self, emission: OutgoingMessage) -> None:
        payload = encode(emission.topic, emission.message)
        if emission.topic in STATUS_TOPICS:
            self._latest[emission.topic] = payload
        try:
            self._publishers[emission.topic].put(payload)
        except zenoh.ZError as error:
            log.error("%s could not be put: %s", emission.topic, error)

    def _take(self, query: Query) -> None:
        """Status is answered here; what may change something goes to the desk."""
        if query.verb == "status" or self._desk is None:
            self._reply(query, json.dumps({topic: json.loads(text) for topic, text in self._latest.items()}).encode())
        elif (why := self._refusal(query)) is not None:
            self._answer(query, Answer(id="", request="", accepted=False, text=why))
        else:
            payload = b"" if query.query.payload is None else query.query.payload.to_bytes()
            asked = PendingRequest(query.verb, payload, lambda answer: self.inbox.put(Reply(query, answer)))
            if not self._desk.submit(asked):
                self._answer(query, Answer(id="", request="", accepted=False, text="busy: too many requests wait"))

    def _refusal(self, query: Query) -> str | None:
        payload = query.query.payload
        if payload is not None and len(payload) > LARGEST_PAYLOAD:
            return f"a request of {len(payload)} bytes; {LARGEST_PAYLOAD} is the most"
        if query.verb in VERBS and str(query.query.key_expr) != f"{self._key}/rpc/{query.verb}":
            return f"{query.query.key_expr} may mean several gateways; ask one: {self._key}"
        return None

    def _answer(self, query: Query, answer: Answer) -> None:
        payload = to_json(answer.payload())
        if answer.accepted:
            self._reply(query, payload)
            return
        try:
            with query.query:
                query.query.reply_err(payload, encoding=JSON)
        except zenoh.ZError as error:
            log.error("rpc/%s could not be answered: %s", query.verb, error)

    def _reply(self, query: Query, payload: bytes) -> None:
        try:
            with query.query:
                query.query.reply(f"{self._key}/rpc/{query.verb}", payload, encoding=JSON)
        except zenoh.ZError as error:
            log.error("rpc/%s could not be answered: %s", query.verb, error)

    def close(self) -> None:
        """Leave the bus; the liveliness token goes with the session."""
        for queryable in self._queryables:
            queryable.undeclare()
        if self._load is not None:
            self._load.undeclare()
        self._session.close()
