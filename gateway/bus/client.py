"""One gateway, asked from another process: requests with an id, repeated until they are answered."""

import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import zenoh

from gateway.bus.session import BusError, open_session
from gateway.errors import InputError

CONNECT_MS = 2000
ANSWER_S = 5.0
"""A request is asked again after this; with the same id it is done once."""
PAUSE_S = 0.5


@dataclass(frozen=True, slots=True)
class RpcReply:
    """What a gateway answered."""

    accepted: bool
    content: dict[str, Any]

    @property
    def text(self) -> str:
        """What was done, or why not."""
        return str(self.content.get("text" if self.accepted else "reason", ""))


class Client:
    """Asks one gateway and hears its calibration messages; the link may be lost and found again in between."""

    def __init__(self, connect: str, pattern: str) -> None:
        """`pattern` must mean one gateway only. Raises `InputError` where it means none or several, `BusError`."""
        self._connect = connect
        self._session = self._open()
        self._subscribers: list[zenoh.Subscriber[None]] = []
        try:
            self.key = self._resolve_single_gateway(pattern)
        except InputError:
            self._session.close()
            raise

    def _open(self) -> zenoh.Session:
        return open_session("client", [self._connect], [], connect_timeout_ms=CONNECT_MS)

    def _resolve_single_gateway(self, pattern: str) -> str:
        replies = [reply.ok for reply in self._session.get(f"{pattern}/rpc/status", timeout=ANSWER_S) if reply.ok]
        keys = sorted({str(reply.key_expr).removesuffix("/rpc/status") for reply in replies})
        if not keys:
            raise InputError(f"no gateway {pattern} answers at {self._connect}")
        if len(keys) > 1:
            raise InputError(f"{len(keys)} gateways answer; name one with --gateway: {', '.join(keys)}")
        return keys[0]

    def ask(self, verb: str, request: dict[str, Any], patience_s: float) -> RpcReply | None:
        """Ask until there is an answer; None where there is none in time, and the request may have been done or not."""
        end_s = time.monotonic() + patience_s
        while True:
            if (said := self._ask_once(verb, request)) is not None:
                return said
            if time.monotonic() >= end_s:
                return None
            time.sleep(PAUSE_S)
            self.reconnect()

    def status(self) -> dict[str, Any] | None:
        """The last message of every topic; None where nobody answers."""
        said = self._ask_once("status", None)
        return None if said is None or not said.accepted else said.content

    def _ask_once(self, verb: str, request: dict[str, Any] | None) -> RpcReply | None:
        payload = None if request is None else json.dumps(request)
        try:
            for reply in self._session.get(f"{self.key}/rpc/{verb}", payload=payload, timeout=ANSWER_S):
                if (said := _said(reply)) is not None:
                    return said
        except zenoh.ZError:
            return None  # the link is down; whoever waits asks again
        return None

    def subscribe(self, topic: str, take: Callable[[zenoh.Sample], object]) -> None:
        """Hand messages of a topic on until the next `reconnect` or `close`."""
        self._subscribers.append(self._session.declare_subscriber(f"{self.key}/{topic}", take))

    def reconnect(self) -> bool:
        """Open the link anew; False where nobody is there yet."""
        self.close()
        try:
            self._session = self._open()
        except BusError:
            return False
        return True

    def close(self) -> None:
        """Leave the bus."""
        self._subscribers.clear()
        with suppress(zenoh.ZError):
            self._session.close()


def _said(reply: zenoh.Reply) -> RpcReply | None:
    """The gateway's word; None for an error of the bus itself, such as a time-out."""
    answer = reply.ok or reply.err
    if answer is None:
        return None
    try:
        content = json.loads(answer.payload.to_bytes())
    except ValueError:
        return None
    return RpcReply(reply.ok is not None, content) if isinstance(content, dict) else None
