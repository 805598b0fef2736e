"""A client of Modbus TCP on a bare socket, written from the specification and not from the server."""

import socket
import struct
from typing import Self

from tests.waiting import PATIENCE_S


class ModbusRefusedError(Exception):
    """The server has answered with an exception; its code is the argument."""


class ModbusClient:
    """One connection."""

    def __init__(self, port: int, timeout_s: float = PATIENCE_S) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout_s)
        self._transaction = 0

    def ask(self, pdu: bytes, unit: int = 1) -> bytes:
        """Send a request and return the answer behind the unit. Raises `ModbusRefusedError`, `OSError`, `EOFError`."""
        self._transaction += 1
        self.socket.sendall(struct.pack(">HHHB", self._transaction, 0, len(pdu) + 1, unit) + pdu)
        transaction, protocol, length, answered = struct.unpack(">HHHB", self.receive(7))
        assert (transaction, protocol, answered) == (self._transaction, 0, unit)
        content = self.receive(length - 1)
        if content[0] & 0x80:
            assert content[0] & 0x7F == pdu[0]
            raise ModbusRefusedError(content[1])
        return content

    def read(self, first: int = 0, count: int = 52, function: int = 4) -> list[int]:
        """Return registers."""
        content = self.ask(struct.pack(">BHH", function, first, count))
        assert content[:2] == bytes((function, 2 * count))
        return list(struct.unpack(f">{count}H", content[2:]))

    def receive(self, length: int) -> bytes:
        received = b""
        while len(received) < length:
            chunk = self.socket.recv(length - len(received))
            if not chunk:
                raise EOFError("the server has closed the connection")
            received += chunk
        return received

    def close(self) -> None:
        self.socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
