"""The server of Modbus TCP: input registers that are read and never written (Modbus Application Protocol 1.1b3).

A few connections at a time, each closed that is silent, malformed, or does not take its answers. The register map has every
value as a scaled integer, the measured ones also as numbers of 32 bits; high word first.

The server of the usual library, pymodbus 3.16, answers the first of several requests in one segment only, stays silent for ever
after one malformed frame, and limits neither connections nor their idleness; its client is the other party of the tests.
"""

import asyncio
import logging
import socket
import struct
import time
from collections.abc import Callable
from ipaddress import IPv6Address, ip_address, ip_network

from gateway.bridge.plant_snapshot import PlantSnapshot
from gateway.bridge.plant_values import PLANT_VALUES, PlantValue
from gateway.bridge.settings import ModbusSection, cannot_listen
from gateway.configuration.section import host_and_port

log = logging.getLogger("plumbline.modbus")
LOOK_S = 0.1
"""Time between two looks at what is known, whether or not somebody asks. Basis: a choice; readings come ten times a second."""
LONGEST_FRAME_S = 2.0
"""A request that has begun is complete, and an answer taken, within this time. Basis: a choice; a lost packet is repeated
within less."""
IN_USE_S = 1.0
"""A connection that has asked within this time is not closed for another one. Basis: a choice; controllers poll more often."""
MOST_WAITING_BYTES = 4096
"""Answers that may wait for a client, here and again in the system. Basis: a choice; a dozen, and a bound of the memory."""
HEADER = struct.Struct(">HHHB")
"""Transaction, protocol (0), number of bytes that follow, unit."""
READ_INPUT_REGISTERS = 4
"""Definition: Modbus Application Protocol 1.1b3, section 6.4."""
MOST_REGISTERS = 125
"""Registers in one answer. Definition: Modbus Application Protocol 1.1b3, section 6.4."""
LONGEST_PDU = 253
"""Bytes of a request behind its unit. Definition: Modbus Application Protocol 1.1b3, section 4.1."""
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
"""Codes of refusals. Definition: Modbus Application Protocol 1.1b3, section 7."""
NOT_KNOWN = 0x7FFF
"""An integer that is not known, and a register without a value: the largest one with and without a sign. A program that compares
it with a limit finds the limit exceeded; 0x8000 would be far below every limit where it is read with a sign."""
NOT_KNOWN_LONG = 0xFFFF_FFFF
"""The same in two registers."""
REGISTERS = 52
"""Length of the map. Definition: one request reads all of it, up to 125 registers, and so all values of one moment."""


class ModbusServer:
    """Answers every request with what is known at that moment."""

    def __init__(self, section: ModbusSection, snapshot: Callable[[], PlantSnapshot]) -> None:
        self._section, self._snapshot = section, snapshot
        self._used_s: dict[asyncio.StreamWriter, float] = {}
        """Connections, and when each has sent its last request."""
        self._allowed = None if section.clients is None else [ip_network(each) for each in section.clients]
        self._strangers = 0
        """Connections that were refused because of their address."""
        self._is_full = False
        """Whether the log has said so since the last connection that was taken."""

    async def serve(self, started: Callable[[], None]) -> None:
        """Serve until cancelled; `started` is called when clients can connect. Raises `InputError`."""
        host, port = host_and_port(self._section.listen)
        try:
            server = await asyncio.start_server(self._accept, host, port, limit=MOST_WAITING_BYTES)
        except OSError as error:
            raise cannot_listen("modbus.listen", self._section.listen, error) from error
        started()
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(server.serve_forever())
                tasks.create_task(self._keep_looking())
        finally:
            for connection in list(self._used_s):
                connection.transport.abort()

    async def _keep_looking(self) -> None:
        """Follow the gateway also without a client, so that the first one gets the present state, and the heartbeat rises."""
        while True:
            self._snapshot()
            await asyncio.sleep(LOOK_S)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = writer.get_extra_info("peername")
        try:
            if not self._is_allowed(peer[0]):
                return
            if not self._make_room():
                if not self._is_full:
                    log.warning("%s is refused: %d connections are in use", peer, len(self._used_s))
                self._is_full = True
                return
            self._is_full = False
            self._used_s[writer] = time.monotonic()
            writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_WAITING_BYTES)
            writer.transport.set_write_buffer_limits(MOST_WAITING_BYTES)
            await self._answer_all(reader, writer)
        except (asyncio.IncompleteReadError, ConnectionError, TimeoutError):
            pass  # it has ended, or is silent
        finally:
            self._used_s.pop(writer, None)
            writer.transport.abort()

    def _is_allowed(self, address: str) -> bool:
        """Return whether an address may connect; others are counted, and the log says so at 1, 10, 100 of them."""
        given = ip_address(address.partition("%")[0])
        plain = (given.ipv4_mapped or given) if isinstance(given, IPv6Address) else given
        if self._allowed is None or any(plain in network for network in self._allowed):
            return True
        self._strangers += 1
        if f"{self._strangers}".strip("0") == "1":
            log.warning("%s is refused: it is not among modbus.clients (%d so far)", address, self._strangers)
        return False

    def _make_room(self) -> bool:
        """Return whether one more connection may be held; the one that is idle for the longest time makes room for it."""
        if len(self._used_s) < self._section.max_connections:
            return True
        idle = min(self._used_s, key=self._used_s.__getitem__)
        if time.monotonic() - self._used_s[idle] < IN_USE_S:
            return False
        del self._used_s[idle]
        idle.transport.abort()
        return True

    async def _answer_all(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer requests until one is malformed: where the next one begins is not known then."""
        while True:
            async with asyncio.timeout(self._section.idle_s):
                header = await reader.readexactly(HEADER.size)
            if (length := request_length(header)) is None:
                return
            self._used_s[writer] = time.monotonic()
            async with asyncio.timeout(LONGEST_FRAME_S):
                request = await reader.readexactly(length)
                writer.write(answer(header, request, encode_registers(self._snapshot())))
                await writer.drain()
            await asyncio.sleep(0)  # others get their turn, however much this one sends


def request_length(header: bytes) -> int | None:
    """Return the number of bytes that follow the header of a request; None where it is none, and its end is not known."""
    _, protocol, length, _ = HEADER.unpack(header)
    return length - 1 if protocol == 0 and 2 <= length <= LONGEST_PDU + 1 else None


def answer(header: bytes, request: bytes, registers: bytes) -> bytes:
    """Return the answer to a request, whatever it asks for."""
    transaction, protocol, _, unit = HEADER.unpack(header)
    content = _read(request, registers)
    return HEADER.pack(transaction, protocol, len(content) + 1, unit) + content


def _read(request: bytes, registers: bytes) -> bytes:
    function = request[0]
    if function != READ_INPUT_REGISTERS:
        return _refuse(function, ILLEGAL_FUNCTION)
    if len(request) != 5:
        return _refuse(function, ILLEGAL_VALUE)
    first, count = struct.unpack(">HH", request[1:])
    if not 1 <= count <= MOST_REGISTERS:
        return _refuse(function, ILLEGAL_VALUE)
    wanted = registers[2 * first : 2 * (first + count)]
    if len(wanted) != 2 * count:
        return _refuse(function, ILLEGAL_ADDRESS)
    return bytes((function, len(wanted))) + wanted


def _refuse(function: int, code: int) -> bytes:
    return bytes((function | 0x80, code))


def encode_registers(snapshot: PlantSnapshot) -> bytes:
    """Return the content of all input registers, two bytes each, the high one first."""
    content = bytearray(NOT_KNOWN.to_bytes(2, "big") * REGISTERS)
    for value in PLANT_VALUES:
        number = value.number(snapshot)
        _put(content, value.register, _encode_integer(value, number))
        if value.float_register is not None:
            _put(content, value.float_register, struct.pack(">f", float("nan") if number is None else number))
    return bytes(content)


def _put(content: bytearray, register: int, encoded: bytes) -> None:
    content[2 * register : 2 * register + len(encoded)] = encoded


def _encode_integer(value: PlantValue, number: float | int | None) -> bytes:
    unknown = NOT_KNOWN if value.words == 1 else NOT_KNOWN_LONG
    scaled = unknown if number is None else round(number / value.step)
    return scaled.to_bytes(2 * value.words, "big")
