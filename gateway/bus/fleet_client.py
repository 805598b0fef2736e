"""The client of all gateways on a router: one session that receives their states and liveliness."""

import time
from collections.abc import Sequence
from contextlib import suppress

import zenoh
from pydantic_core import from_json, to_json

from gateway.bus.client import ANSWER_S, STATUS, open_client_session
from gateway.bus.credentials import Credentials
from gateway.bus.fleet_inbox import LARGEST_PAYLOAD, FleetInbox
from gateway.topics import STATE_TOPICS

ALIVE = "alive"
LARGEST_STATUS = 1 << 20
"""Largest status of a gateway, bytes. Basis: as for any message, `untrusted.LARGEST_PAYLOAD`."""


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
        self._session = open_client_session(connect, credentials)
        self._subscribers = [self._session.declare_subscriber(f"{pattern}/{topic}", self._receive) for topic in topics]
        self._liveliness = self._session.liveliness().declare_subscriber(
            f"{pattern}/{ALIVE}", self._receive_alive, history=True
        )

    def request_latest(self) -> None:
        """Ask gateways and storages for their last messages, without waiting for the answers."""
        with suppress(zenoh.ZError):  # the link is down
            self._session.get(f"{self._pattern}/{STATUS}", self._receive_status, timeout=ANSWER_S)
            for topic in STATE_TOPICS:
                self._session.get(f"{self._pattern}/{topic}", self._receive_stored, timeout=ANSWER_S)

    @property
    def connected(self) -> bool:
        """Whether a router or a gateway is connected."""
        return bool(self._session.info.routers_zid() or self._session.info.peers_zid())

    def close(self) -> None:
        """Close the session."""
        with suppress(zenoh.ZError):
            self._session.close()

    def _receive(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._put(sample, live=True)

    def _receive_alive(self, sample: zenoh.Sample) -> None:
        self.inbox.put_alive(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

    def _receive_stored(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self._put(reply.ok, live=False)

    def _put(self, sample: zenoh.Sample, *, live: bool) -> None:
        if len(sample.payload) > LARGEST_PAYLOAD:
            self.inbox.count_refused()
        else:
            self.inbox.put(str(sample.key_expr), sample.payload.to_bytes(), time.monotonic(), live=live)

    def _receive_status(self, reply: zenoh.Reply) -> None:
        sample = reply.ok
        if sample is None:
            return
        status: object = None
        if len(sample.payload) <= LARGEST_STATUS:
            with suppress(ValueError):
                status = from_json(sample.payload.to_bytes())
        if not isinstance(status, dict):
            self.inbox.count_refused()
            return
        key = str(sample.key_expr).removesuffix(f"/{STATUS}")
        for topic in STATE_TOPICS:
            if topic in status:
                self.inbox.put(f"{key}/{topic}", to_json(status[topic]), time.monotonic(), live=False)
