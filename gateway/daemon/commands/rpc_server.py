"""How requests come in: the thread that serves remote calls, and what people do on the page.

The thread takes requests from the bus, and sends the answers. It also takes the load signal, and what the page reports about
signing in: the wrong PINs that people enter.
"""

import logging
import queue
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import zenoh
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from gateway.authorization.authoriser import SignedRequest
from gateway.authorization.caller import Caller, NotAuthorised, Role, require_role
from gateway.authorization.message_signature import MessageSigner, Question, join_signature
from gateway.bus.session import describe_links
from gateway.daemon.commands.requests import RemoteRequest, RequestDispatcher, RequestHandler
from gateway.daemon.commands.security import Refusal, SecurityLog
from gateway.daemon.commands.worker import RecalibrationService
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.page.sign_in import SignInReport
from gateway.recalibration.requests import LoadSignal, RequestError, parse_payload
from gateway.verbs import VERBS

PATIENCE_S = 4.0
"""Longest wait for an answer. Basis: a choice; below the 6 s for which the page waits (`gateway.page.actions`)."""
PIN_GUESSED = "pin_guessed"
log = logging.getLogger("plumbline.rpc")
INBOX = 256
"""Requests and answers that may wait. Basis: a choice; more than honest callers cause at once, and a bound of the memory."""
RESERVED_FOR_ANSWERS = 64
"""Places of the inbox that a flood of requests cannot take. Basis: a choice; more than the commands that may wait at once, and a
quarter of the inbox."""
JSON = zenoh.Encoding.APPLICATION_JSON


class PageRequest(BaseModel):
    """A request as the page sends it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    """Number that the answer repeats."""
    verb: str
    payload: str


class PageRequests:
    """Passes requests of the page on to the same handlers as those of the bus. The page has checked the person's PIN."""

    def __init__(self, handlers: Mapping[str, RequestHandler]) -> None:
        self._handlers = handlers

    def answer(self, packet: bytes) -> bytes:
        """Carry out a request and return the answer as JSON. Called by the thread of the page's channel."""
        try:
            request = PageRequest.model_validate_json(packet)
        except ValidationError:
            return to_json({"number": None, "accepted": False, "text": "no request of the page"})
        accepted, text = self._carry_out(request)
        return to_json({"number": request.number, "accepted": accepted, "text": text})

    def _carry_out(self, request: PageRequest) -> tuple[bool, str]:
        handler = self._handlers.get(request.verb)
        if handler is None:
            return False, f"{request.verb} is not available"
        answers: queue.SimpleQueue[tuple[bool, str]] = queue.SimpleQueue()
        try:
            handler(_admit(request, answers))
            return answers.get(timeout=PATIENCE_S)
        except (NotAuthorised, RequestError) as refusal:
            return False, str(refusal)
        except queue.Empty:
            return False, f"no answer in {PATIENCE_S:.0f} s; it may have been done"


def _admit(request: PageRequest, answers: "queue.SimpleQueue[tuple[bool, str]]") -> RemoteRequest:
    """Return the request of an operator for its handler. Raises `NotAuthorised` or `RequestError`."""
    verb, caller = VERBS[request.verb], Caller(None, Role.OPERATOR, "page_pin")
    if verb.role is not None:
        require_role(caller, verb.role)

    def reply(accepted: bool, content: Mapping[str, Any]) -> None:
        answers.put((accepted, str(content.get("text" if accepted else "reason", ""))))

    return RemoteRequest(verb.name, parse_payload(verb.request, request.payload.encode()), caller, reply)


class SignInWatch:
    """Takes the reports of the page; used by the thread of the remote calls alone."""

    def __init__(
        self, security_log: SecurityLog, faults: FaultRegister, pin_file: Path, now_ns: Callable[[], int]
    ) -> None:
        self._security_log = security_log
        self._faults = faults
        self._pin_file = pin_file
        self._now_ns = now_ns

    def take(self, payload: bytes) -> None:
        """Count what a report says. The fault stands until somebody signs in with the new PIN."""
        try:
            report = SignInReport.model_validate_json(payload)
        except ValidationError:
            return
        if report.wrong:
            refusal = Refusal("page/sign-in", "wrong_pin", None, "a PIN was entered that is not that of this gateway")
            self._security_log.add(refusal, lambda: report.address, self._now_ns(), report.wrong)
        match report.pin:
            case "replaced":
                text = f"the PIN of the page is void after too many wrong ones: somebody guesses; {self._pin_file} has a new one"
                self._faults.set(PIN_GUESSED, text)
            case "void":
                text = f"{self._pin_file}: the PIN is void after too many wrong ones, and no new one can be written"
                self._faults.set(PIN_GUESSED, text)
            case "good":
                self._faults.clear(PIN_GUESSED)


@dataclass(frozen=True, slots=True)
class IncomingQuery:
    """A query with the verb that it asks for."""

    verb: str
    query: zenoh.Query

    @property
    def question(self) -> Question:
        """What was asked, as it has come."""
        payload, attachment = self.query.payload, self.query.attachment
        return Question(
            b"" if payload is None else payload.to_bytes(), b"" if attachment is None else attachment.to_bytes()
        )


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a query."""

    query: IncomingQuery
    accepted: bool
    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class RefusedSignal:
    """What came without a question on a key of the gateway and was not taken, and why."""

    key: str
    """The key below that of the gateway."""
    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class IncomingSignInReport:
    """A report of the page."""

    payload: bytes


RpcItem = IncomingQuery | Answer | RefusedSignal | IncomingSignInReport


class RpcServer(Worker[RpcItem]):
    """Answers queries on `<key>/rpc/<verb>`. It must end before the session is closed."""

    def __init__(
        self,
        key: str,
        dispatcher: RequestDispatcher,
        recalibration: RecalibrationService,
        sign_ins: SignInWatch,
        signer: MessageSigner,
        *,
        prepare: Callable[[], None],
    ) -> None:
        """`prepare` is called once, by the thread, before the first request; it may wait for the disk."""
        super().__init__("rpc", BoundedQueue(INBOX))
        self._session: zenoh.Session | None = None
        self._key = key
        self._dispatcher = dispatcher
        self._recalibration = recalibration
        self._sign_ins = sign_ins
        self._signer = signer
        self._prepare = prepare
        self._queryables: list[zenoh.Queryable[None]] = []
        self._load: zenoh.Subscriber[None] | None = None

    def run(self) -> None:
        """Prepare, then answer until the end."""
        self._attempt(self._prepare)
        super().run()

    def attach(self, session: zenoh.Session) -> None:
        """Answer the calls of a session from now on. Raises `zenoh.ZError`."""
        self._session = session
        # The session may not be used inside its callbacks: they only put what comes into the inbox.
        self._queryables = [
            session.declare_queryable(f"{self._key}/rpc/{verb}", partial(self._receive_query, verb))
            for verb in self._dispatcher.verbs
        ]
        self._load = session.declare_subscriber(f"{self._key}/load", self._receive_load_signal)

    def _receive_query(self, verb: str, query: zenoh.Query) -> None:
        self.inbox.put(IncomingQuery(verb, query), RESERVED_FOR_ANSWERS)

    def _receive_load_signal(self, sample: zenoh.Sample) -> None:
        """Take a load at once: in the inbox a flood could displace it."""
        try:
            self._recalibration.set_load_signal(parse_payload(LoadSignal, sample.payload.to_bytes()))
        except RequestError as error:
            why = f'{error}; a load signal is JSON such as {{"loaded": true}}'
            self.note_refusal("load", "invalid_signal", why)

    def note_refusal(self, key: str, kind: str, reason: str) -> None:
        """Note what was not taken on a key below that of the gateway. Called by any thread; does not wait."""
        self.inbox.put(RefusedSignal(key, kind, reason), RESERVED_FOR_ANSWERS)

    def receive_sign_in_report(self, payload: bytes) -> None:
        """Take a report of the page. Called by the thread of the page's channel; does not wait."""
        self.inbox.put(IncomingSignInReport(payload))

    def handle(self, item: RpcItem) -> None:
        """Take a query or a report, or send an answer."""
        match item:
            case IncomingQuery():
                self._dispatch(item)
            case Answer():
                self._send(item)
            case RefusedSignal():
                self._dispatcher.refuse_signal(item.key, item.kind, item.reason, self._describe_origin)
            case IncomingSignInReport():
                self._sign_ins.take(item.payload)

    def _dispatch(self, item: IncomingQuery) -> None:
        question = item.question
        request = SignedRequest(
            key_expr=str(item.query.key_expr),
            payload=question.payload,
            attachment=None if item.query.attachment is None else question.attachment,
        )
        self._dispatcher.receive(
            item.verb,
            request,
            origin=self._describe_origin,
            reply=lambda accepted, content: self.inbox.put(Answer(item, accepted, content)),
        )

    def _describe_origin(self) -> str:
        return "" if self._session is None else describe_links(self._session)

    def _send(self, answer: Answer) -> None:
        query, payload = answer.query.query, to_json(answer.content)
        key_expr = f"{self._key}/rpc/{answer.query.verb}"
        signature = self._signer.sign_answer(key_expr, payload, answer.query.question, accepted=answer.accepted)
        try:
            with query:
                if answer.accepted:
                    query.reply(key_expr, payload, encoding=JSON, attachment=signature)
                else:
                    query.reply_err(join_signature(payload, signature), encoding=JSON)
        except zenoh.ZError as error:
            log.error("rpc/%s could not be answered: %s", answer.query.verb, error)

    def close(self) -> None:
        """Take no more calls."""
        with suppress(zenoh.ZError):
            for queryable in self._queryables:
                queryable.undeclare()
            if self._load is not None:
                self._load.undeclare()
