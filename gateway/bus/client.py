"""The client of one gateway in another process: requests with an id, repeated until they are answered.

An id in the answer to a fetch request can become the name of a file, and is accepted in the form of one alone.
"""

import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any

import zenoh
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.authorization.credential import Challenge
from gateway.authorization.message_signature import Question
from gateway.bus.authenticity import OLD, Authenticity, Doubt
from gateway.bus.credentials import VARIABLE, Credentials, load_credentials
from gateway.bus.session import BusError, open_session
from gateway.bus.untrusted import gateway_of, make_question, parse_message, parse_status, read_attachment, send_question
from gateway.calibration.store import ID_PATTERN
from gateway.configuration.bus_section import is_encrypted
from gateway.errors import InputError, PlumblineError, printable
from gateway.topics import ALIVE
from gateway.verbs import VERBS

CONNECT_MS = 2000
"""Longest attempt to connect. Basis: a choice; several round trips of a radio link with TLS, and no long wait for a person."""
ANSWER_S = 5.0
"""A request without an answer is repeated after this time. The gateway does a request with the same id once. Basis: a choice; a
step that hangs is refused after 8 s, usual ones take less than a second."""
PAUSE_S = 0.5
"""Pause before a repetition. Basis: a choice; a link is opened again in it, and a person does not wait."""
STATUS = "rpc/status"
PASSING = ("rate_limited", "stale_credential")
Id = Annotated[str, Field(pattern=ID_PATTERN)]
MAX_RECORDS = 1000
"""Basis: a choice; centuries of calibrations, and a bound of a hostile answer."""


class ForgedError(PlumblineError):
    """An answer is not of the gateway whose key is known; the text names what is wrong with it, in one line."""

    exit_code = 1


@dataclass(frozen=True, slots=True)
class RpcReply:
    """The answer of a gateway."""

    accepted: bool
    content: dict[str, Any]
    doubt: Doubt | None = None
    """Why it is not authenticated; None: the gateway has signed it for this request."""

    @property
    def is_to_be_repeated(self) -> bool:
        """Whether the request was refused for a reason that passes: too many at once, or an answer to an old challenge."""
        return not self.accepted and self.content.get("kind") in PASSING

    @property
    def text(self) -> str:
        """What was done, or why it was refused."""
        return printable(str(self.content.get("text" if self.accepted else "reason", "")))


def open_client_session(
    connect: str, credentials: Credentials | None = None, timeout_ms: int = CONNECT_MS
) -> zenoh.Session:
    """Open a session with the gateway or router at an endpoint, by `tls/...` with the certificate of the credentials.

    Without credentials those of this machine are used. Raises `BusError` if nobody answers, `InputError` without a certificate.
    """
    tls = (credentials or load_credentials()).tls if is_encrypted(connect) else None
    if tls is None and is_encrypted(connect):
        raise InputError(
            f"{connect} needs a certificate; name a folder that plumbline keys issue has made by --credentials or {VARIABLE}"
        )
    return open_session("client", [connect], [], tls, connect_timeout_ms=timeout_ms)


@dataclass(frozen=True, slots=True)
class StatusAnswer:
    """The last message of every topic of a gateway."""

    topics: dict[str, dict[str, Any]]
    doubt: Doubt | None
    """Why it is not authenticated; None: it is."""


def query_status(
    session: zenoh.Session, pattern: str, authenticity: Authenticity, timeout_s: float = ANSWER_S
) -> dict[str, StatusAnswer]:
    """Return the answers of the gateways that match a pattern, by their keys; a doubtful one only where there is no other."""
    found: dict[str, StatusAnswer] = {}
    authenticity.meet(session, pattern)
    question, sent_s = make_question(), time.monotonic()
    for reply in send_question(session, f"{pattern}/{STATUS}", question, timeout_s):
        if (sample := reply.ok) is None or (key := gateway_of(sample, STATUS)) is None:
            continue
        topics = parse_status(sample.payload.to_bytes())
        if topics is not None and (key not in found or found[key].doubt is not None):
            found[key] = StatusAnswer(topics, authenticity.judge_reply(f"{key}/{STATUS}", question, reply, sent_s))
    return found


def _keys_alive(session: zenoh.Session, pattern: str) -> set[str]:
    """Return the keys of the gateways that are alive, by their tokens: no flood of requests hides them."""
    found = {gateway_of(reply.ok, ALIVE) for reply in session.liveliness().get(f"{pattern}/{ALIVE}") if reply.ok}
    return {key for key in found if key is not None}


class GatewayClient:
    """Sends requests to one gateway and receives its messages. The link may be lost and restored in between."""

    def __init__(self, connect: str, pattern: str, credentials: Credentials | None = None) -> None:
        """Connect. Raises `InputError` where `pattern` matches no gateway or several, and `BusError`."""
        self._connect = connect
        self._credentials = credentials or load_credentials()
        self.authenticity = Authenticity(self._credentials.signers)
        self._session = open_client_session(connect, self._credentials)
        self._subscribers: list[zenoh.Subscriber[None]] = []
        self.refused = 0
        """Number of messages that are not valid, or not the gateway's."""
        self.doubt: Doubt | None = None
        """Why an answer was not authenticated that was taken nevertheless, because no key of the gateway is known."""
        try:
            self.key = self._resolve_single_gateway(pattern)
        except InputError:
            self._session.close()
            raise
        with suppress(zenoh.ZError):  # the link is down again: requests are repeated
            self.authenticity.meet(self._session, self.key)

    def _resolve_single_gateway(self, pattern: str) -> str:
        keys = sorted(_keys_alive(self._session, pattern))
        if not keys:
            raise InputError(f"no gateway {pattern} answers at {self._connect}")
        if len(keys) > 1:
            raise InputError(f"{len(keys)} gateways answer; name one with --gateway: {', '.join(keys)}")
        return keys[0]

    def ask(self, verb: str, request: dict[str, Any], patience_s: float) -> RpcReply | None:
        """Repeat a request until it is answered; None without an answer in time: the request may have been done or not.

        Raises `ForgedError` where the answer is not of the gateway whose key is known.
        """
        end_s = time.monotonic() + patience_s
        while True:
            if (reply := self._ask_once(verb, request)) is not None:
                return reply
            if time.monotonic() >= end_s:
                return None
            time.sleep(PAUSE_S)
            self.reconnect()

    def status(self) -> dict[str, Any] | None:
        """Return the last message of every topic; None where nobody answers."""
        try:
            answer = query_status(self._session, self.key, self.authenticity).get(self.key)
            return None if answer is None or _is_forged(answer.doubt) else answer.topics
        except (zenoh.ZError, ValueError):
            return None  # the link is down

    def _ask_once(self, verb: str, request: dict[str, Any]) -> RpcReply | None:
        payload = json.dumps(request).encode()
        try:
            key_expr = f"{self.key}/rpc/{verb}"
            attachment: bytes | None = make_question().attachment
            if VERBS[verb].role is not None:
                challenge = self._get("challenge", b"", attachment)
                if challenge is None or challenge.is_to_be_repeated:
                    return None  # without it the request would be refused as one without a credential
                attachment = self._prove(key_expr, payload, challenge)
            reply = self._get(verb, payload, attachment)
        except zenoh.ZError:
            return None  # the link is down
        return None if reply is None or reply.is_to_be_repeated else reply

    def _prove(self, key_expr: str, payload: bytes, answer: RpcReply) -> bytes | None:
        """Return the credential for a request; None without one, so that the gateway states what is missing."""
        try:
            challenge = Challenge.model_validate(answer.content)
        except ValidationError:
            return None  # not the answer of a gateway
        return self._credentials.prove(key_expr, payload, challenge)

    def _get(self, verb: str, payload: bytes, attachment: bytes | None) -> RpcReply | None:
        """Return the first answer that is authenticated; else the first one that can be read. Raises `ForgedError`."""
        key_expr, sent_s = f"{self.key}/rpc/{verb}", time.monotonic()
        question, doubtful = Question(payload, attachment or b""), None
        for reply in send_question(self._session, key_expr, question, ANSWER_S):
            doubt = self.authenticity.judge_reply(key_expr, question, reply, sent_s)
            if (decoded := _decode(reply, doubt)) is not None:
                if doubt is None:
                    return decoded
                doubtful = doubtful or decoded
        self.doubt = self.doubt if doubtful is None else doubtful.doubt
        if doubtful is not None and _is_forged(doubtful.doubt):
            raise ForgedError(f"{self.key}: {doubtful.doubt}; nothing in it is believed")
        return doubtful

    def subscribe(self, topic: str, receive: Callable[[dict[str, Any]], object]) -> None:
        """Pass the valid messages of a topic to a function until the next `reconnect` or `close`; others are counted."""

        def check(sample: zenoh.Sample) -> None:
            payload, at_s = sample.payload.to_bytes(), time.monotonic()
            message = parse_message(topic, payload)
            doubt = self.authenticity.judge_message(self.key, topic, payload, read_attachment(sample), at_s)
            if message is None or _is_forged(doubt) or doubt is OLD:
                self.refused += 1
            else:
                receive(message)

        self._subscribers.append(self._session.declare_subscriber(f"{self.key}/{topic}", check))

    def reconnect(self) -> bool:
        """Open the link again; return False while nobody answers."""
        self.close()
        try:
            self._session = open_client_session(self._connect, self._credentials)
        except BusError:
            return False
        self.authenticity.ask(self._session)  # where its messages seemed late
        return True

    def close(self) -> None:
        """Close the link."""
        self._subscribers.clear()
        with suppress(zenoh.ZError):
            self._session.close()


def _is_forged(doubt: Doubt | None) -> bool:
    return doubt is not None and doubt.kind == "wrong"


def _decode(reply: zenoh.Reply, doubt: Doubt | None) -> RpcReply | None:
    """Return the gateway's answer; None for an error of the bus itself, such as a timeout."""
    answer = reply.ok or reply.err
    if answer is None:
        return None
    try:
        content = json.loads(answer.payload.to_bytes())
    except (ValueError, RecursionError):
        return None
    return RpcReply(reply.ok is not None, content, doubt) if isinstance(content, dict) else None


class FetchedEntry(BaseModel):
    """One record in the list."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    id: Id
    error: str | None = None
    """Why the gateway cannot read it."""


class FetchedList(BaseModel):
    """The list of records."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    device_id: str
    in_force: Id | None
    review: Id | None
    history: list[dict[str, Any]]
    records: list[FetchedEntry] = Field(max_length=MAX_RECORDS)


class FetchedRecord(BaseModel):
    """One record."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    record: dict[str, Any]


class FetchedAudit(BaseModel):
    """The newest entries of the audit."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    audit: list[dict[str, Any]]
