"""The client of all gateways on a router: one session that receives their states and liveliness."""

import time
from collections.abc import Sequence
from contextlib import suppress
from functools import partial

import zenoh
from pydantic_core import from_json, to_json

from gateway.authorization.message_signature import Question
from gateway.bus.authenticity import Authenticity
from gateway.bus.client import ANSWER_S, STATUS, open_client_session
from gateway.bus.credentials import Credentials, load_credentials
from gateway.bus.fleet_inbox import LARGEST_STATE_BYTES, FleetBatch, FleetInbox
from gateway.bus.untrusted import LARGEST_MESSAGE_BYTES, make_question, read_attachment, send_question
from gateway.topics import ALIVE, STATE_TOPICS, UNSIGNED_TOPICS


class FleetClient:
    """Receives the states of the gateways that match a pattern. The library restores a lost link by itself."""

    def __init__(
        self,
        connect: str,
        pattern: str,
        credentials: Credentials | None = None,
        topics: Sequence[str] = STATE_TOPICS,
        inbox: FleetInbox | None = None,
    ) -> None:
        """Connect and subscribe to topics. Raises `BusError` where nobody answers."""
        self.inbox = FleetInbox() if inbox is None else inbox
        self._pattern = pattern
        credentials = credentials or load_credentials()
        self._authenticity = Authenticity(credentials.signers)
        self.session = open_client_session(connect, credentials)
        """The session, which others may use until `close`."""
        self._subscribers = [self.session.declare_subscriber(f"{pattern}/{topic}", self._receive) for topic in topics]
        self._liveliness = self.session.liveliness().declare_subscriber(
            f"{pattern}/{ALIVE}", self._receive_alive, history=True
        )

    def request_latest(self) -> None:
        """Ask gateways and storages for their last messages, without waiting for the answers."""
        with suppress(zenoh.ZError):  # the link is down
            question, sent_s = make_question(), time.monotonic()
            take = partial(self._receive_status, question, sent_s)
            send_question(self.session, f"{self._pattern}/{STATUS}", question, ANSWER_S, take)
            for topic in STATE_TOPICS:
                self.session.get(f"{self._pattern}/{topic}", self._receive_stored, timeout=ANSWER_S)

    def receive(self) -> FleetBatch:
        """Return everything that has come since the last call, and ask the gateways whose messages cannot be judged yet."""
        self._authenticity.ask(self.session)
        return self.inbox.drain()

    @property
    def connected(self) -> bool:
        """Whether a router or a gateway is connected."""
        return bool(self.session.info.routers_zid() or self.session.info.peers_zid())

    def close(self) -> None:
        """Close the session."""
        with suppress(zenoh.ZError):
            self.session.close()

    def _receive(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._put(sample, live=True)

    def _receive_alive(self, sample: zenoh.Sample) -> None:
        is_alive = sample.kind == zenoh.SampleKind.PUT
        if is_alive:
            self._authenticity.expect(str(sample.key_expr).removesuffix(f"/{ALIVE}"))
        self.inbox.put_alive(str(sample.key_expr), is_alive)

    def _receive_stored(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self._put(reply.ok, live=False)

    def _put(self, sample: zenoh.Sample, *, live: bool) -> None:
        if len(sample.payload) > LARGEST_STATE_BYTES:
            self.inbox.count_refused()
            return
        key_expr, payload, at_s = str(sample.key_expr), sample.payload.to_bytes(), time.monotonic()
        name, _, topic = key_expr.rpartition("/")
        doubt = None
        if topic not in UNSIGNED_TOPICS:
            doubt = self._authenticity.judge_message(name, topic, payload, read_attachment(sample), at_s, live=live)
        self.inbox.put(key_expr, payload, at_s, live=live, doubt=doubt)

    def _receive_status(self, question: Question, sent_s: float, reply: zenoh.Reply) -> None:
        sample = reply.ok
        if sample is None:
            return
        status: object = None
        if len(sample.payload) <= LARGEST_MESSAGE_BYTES:
            with suppress(ValueError):
                status = from_json(sample.payload.to_bytes())
        if not isinstance(status, dict):
            self.inbox.count_refused()
            return
        key = str(sample.key_expr).removesuffix(f"/{STATUS}")
        doubt = self._authenticity.judge_reply(str(sample.key_expr), question, reply, sent_s)
        for topic in STATE_TOPICS:
            if topic in status:
                self.inbox.put(f"{key}/{topic}", to_json(status[topic]), time.monotonic(), live=False, doubt=doubt)
