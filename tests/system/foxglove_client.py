"""A client of the Foxglove WebSocket protocol, written from its specification: handshake (RFC 6455), JSON and binary frames."""

import base64
import json
import os
import re
import socket
import struct
import time
from collections.abc import Callable
from typing import Any, Self

from tests.waiting import PATIENCE_S

TEXT, BINARY, CLOSE, PING = 1, 2, 8, 9
MESSAGE_DATA, TIME = 1, 2


class FoxgloveClient:
    """Reads frames when it is asked to, and keeps what the server has said."""

    def __init__(self, port: int, *, receive_bytes: int | None = None) -> None:
        self.socket = socket.socket()
        if receive_bytes is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(("127.0.0.1", port))
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        self._waiting = b""
        while b"\r\n\r\n" not in self._waiting:
            self._waiting += self.socket.recv(4096)
        head, _, self._waiting = self._waiting.partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 101"), head
        self.sessions: list[str] = []
        self._wanted: tuple[str, ...] = ()
        self._names: dict[int, str] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        """What is advertised, by topic."""
        self.statuses: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[dict[str, Any]]] = {}
        self.times_ns: dict[str, list[int]] = {}
        """The times of the messages."""
        self.clock_ns: list[int] = []
        """What the server has said of its own time."""

    def subscribe(self, *topics: str) -> Self:
        """Subscribe to topics, as often as they are advertised; without any, to all that are advertised."""
        self.until(lambda: "/bridge" in self.channels)
        self._wanted = topics or tuple(self.channels)
        self._ask([self.channels[topic] for topic in self._wanted])
        return self

    def _ask(self, channels: list[dict[str, Any]]) -> None:
        self._names |= {channel["id"]: channel["topic"] for channel in channels}
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
        self._send(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode())

    def until(self, condition: Callable[[], object], timeout_s: float = PATIENCE_S) -> None:
        """Read until a condition holds."""
        end_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end_s, (
                self.statuses,
                {topic: len(all_) for topic, all_ in self.messages.items()},
            )
            self._take(*self._receive())

    @property
    def state(self) -> str | None:
        """The last word on the gateway."""
        return self.messages["/bridge"][-1]["state"] if "/bridge" in self.messages else None

    def close(self) -> None:
        self.socket.close()

    def _take(self, opcode: int, payload: bytes) -> None:
        assert opcode != CLOSE
        if opcode == BINARY and payload[0] == MESSAGE_DATA:
            subscription, log_time_ns = struct.unpack_from("<IQ", payload, 1)
            self.messages.setdefault(self._names[subscription], []).append(json.loads(payload[13:]))
            self.times_ns.setdefault(self._names[subscription], []).append(log_time_ns)
        if opcode == BINARY and payload[0] == TIME:
            self.clock_ns += struct.unpack_from("<Q", payload, 1)
        if opcode == TEXT:
            self._take_text(json.loads(payload))

    def _take_text(self, said: dict[str, Any]) -> None:
        match said["op"]:
            case "serverInfo":
                self.sessions.append(said["sessionId"])
                self.statuses.clear()
            case "advertise":
                self.channels |= {channel["topic"]: channel for channel in said["channels"]}
                self._ask([channel for channel in said["channels"] if channel["topic"] in self._wanted])
            case "unadvertise":
                gone = set(said["channelIds"])
                self.channels = {topic: each for topic, each in self.channels.items() if each["id"] not in gone}
            case "status" if unknown := re.fullmatch(r"Unknown channel ID: (\d+)", said["message"]):
                # foxglove-sdk 0.30.3 advertises a channel just before it knows it; or its end crossed the subscription
                self._ask([each for each in self.channels.values() if each["id"] == int(unknown[1])])
            case "status":
                self.statuses[said.get("id", said["message"])] = said
            case "removeStatus":
                for number in said["statusIds"]:
                    self.statuses.pop(number, None)

    def _exactly(self, n_bytes: int) -> bytes:
        while len(self._waiting) < n_bytes:
            more = self.socket.recv(65536)
            assert more, "the server has closed the connection"
            self._waiting += more
        taken, self._waiting = self._waiting[:n_bytes], self._waiting[n_bytes:]
        return taken

    def _receive(self) -> tuple[int, bytes]:
        first, length = self._exactly(2)
        assert first & 0x80, "a fragment"
        if length == 126:
            (length,) = struct.unpack(">H", self._exactly(2))
        elif length == 127:
            (length,) = struct.unpack(">Q", self._exactly(8))
        return first & 0x0F, self._exactly(length)

    def _send(self, payload: bytes) -> None:
        """Send a text frame; a client masks its frames, here by zeros."""
        assert len(payload) < 65536
        self.socket.sendall(bytes((0x80 | TEXT, 0x80 | 126)) + struct.pack(">H", len(payload)) + bytes(4) + payload)
