"""The thread that serves remote calls: the status, the requests of a recalibration, and the load signal."""

import json
import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import zenoh
from pydantic_core import to_json

from gateway.daemon.acknowledgement_service import AcknowledgementService
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.mark_service import MarkService
from gateway.daemon.recalibration_service import PendingRequest, RecalibrationService
from gateway.daemon.worker import Worker
from gateway.recalibration.journal import RequestAnswer
from gateway.recalibration.requests import MAX_PAYLOAD_BYTES, VERBS

log = logging.getLogger("plumbline.rpc")
INBOX = 256
NOT_IN_STATUS = "samples"
JSON = zenoh.Encoding.APPLICATION_JSON


@dataclass(frozen=True, slots=True)
class IncomingQuery:
    """A query with the verb that it asks for."""

    verb: str
    query: zenoh.Query


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a query."""

    query: IncomingQuery
    answer: RequestAnswer


@dataclass(frozen=True, slots=True)
class IncomingLoadSignal:
    """A message of the crane's load signal."""

    sample: zenoh.Sample


RpcItem = IncomingQuery | Reply | IncomingLoadSignal


class RpcServer(Worker[RpcItem]):
    """Answers queries on `<key>/rpc/<verb>`. It must end before the session is closed."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        latest: Callable[[], dict[str, bytes]],
        recalibration: RecalibrationService,
        marks: MarkService,
        acknowledgements: AcknowledgementService,
    ) -> None:
        """`latest` returns the last message of each topic, for the status."""
        self._marks = marks
        self._acknowledgements = acknowledgements
        super().__init__("rpc", BoundedQueue(INBOX))
        self._key = key
        self._latest = latest
        self._recalibration = recalibration
        # The session may not be used inside its callbacks: they only put what comes into the inbox.
        self._queryables = [
            session.declare_queryable(f"{key}/rpc/{verb}", partial(self._receive_query, verb))
            for verb in ("status", *VERBS, "fetch", "mark", "acknowledge")
        ]
        self._load = session.declare_subscriber(f"{key}/load", self._receive_load_signal)

    def _receive_query(self, verb: str, query: zenoh.Query) -> None:
        self.inbox.put(IncomingQuery(verb, query))

    def _receive_load_signal(self, sample: zenoh.Sample) -> None:
        self.inbox.put(IncomingLoadSignal(sample))

    def handle(self, item: RpcItem) -> None:
        """Take a query or a load signal, or send an answer."""
        match item:
            case IncomingQuery(verb="status"):
                self._reply(item, self._status())
            case IncomingQuery():
                self._submit(item)
            case Reply():
                self._answer(item.query, item.answer)
            case IncomingLoadSignal() if len(item.sample.payload) <= MAX_PAYLOAD_BYTES:
                self._recalibration.set_load_signal(item.sample.payload.to_bytes())

    def _status(self) -> bytes:
        latest = {topic: json.loads(text) for topic, text in self._latest().items() if topic != NOT_IN_STATUS}
        return json.dumps(latest).encode()

    def _submit(self, query: IncomingQuery) -> None:
        """Pass a request on to the processing thread, which answers it through the inbox."""
        if (why := self._refusal(query)) is not None:
            self._refuse(query, why)
            return
        payload = b"" if query.query.payload is None else query.query.payload.to_bytes()
        if query.verb == "mark":
            self._answer(query, self._marks.answer(payload))
            return
        request = PendingRequest(query.verb, payload, lambda answer: self.inbox.put(Reply(query, answer)))
        service = self._acknowledgements if query.verb == "acknowledge" else self._recalibration
        if not service.submit(request):
            self._refuse(query, "busy: too many requests are waiting")

    def _refusal(self, query: IncomingQuery) -> str | None:
        payload = query.query.payload
        if payload is not None and len(payload) > MAX_PAYLOAD_BYTES:
            return f"a request of {len(payload)} bytes; {MAX_PAYLOAD_BYTES} is the most"
        if (
            query.verb in (*VERBS, "mark", "acknowledge")
            and str(query.query.key_expr) != f"{self._key}/rpc/{query.verb}"
        ):
            return f"{query.query.key_expr} may mean several gateways; ask one: {self._key}"
        return None

    def _refuse(self, query: IncomingQuery, why: str) -> None:
        self._answer(query, RequestAnswer(id="", request="", accepted=False, text=why))

    def _answer(self, query: IncomingQuery, answer: RequestAnswer) -> None:
        payload = to_json(answer.payload())
        if answer.accepted:
            self._reply(query, payload)
            return
        try:
            with query.query:
                query.query.reply_err(payload, encoding=JSON)
        except zenoh.ZError as error:
            log.error("rpc/%s could not be answered: %s", query.verb, error)

    def _reply(self, query: IncomingQuery, payload: bytes) -> None:
        try:
            with query.query:
                query.query.reply(f"{self._key}/rpc/{query.verb}", payload, encoding=JSON)
        except zenoh.ZError as error:
            log.error("rpc/%s could not be answered: %s", query.verb, error)

    def close(self) -> None:
        """Take no more calls."""
        with suppress(zenoh.ZError):
            for queryable in self._queryables:
                queryable.undeclare()
            self._load.undeclare()
