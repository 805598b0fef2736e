"""The connections of Modbus TCP: a few at a time, each closed that is silent, malformed, or does not take its answers."""

import asyncio
import logging
import socket
import time
from collections.abc import Callable

from gateway.bridge.modbus.modbus_frames import HEADER, answer, request_length
from gateway.bridge.modbus.registers import encode_registers
from gateway.bridge.plant_snapshot import PlantSnapshot
from gateway.bridge.settings import ModbusSection
from gateway.configuration.section import host_and_port
from gateway.errors import InputError

log = logging.getLogger("plumbline.modbus")
LONGEST_FRAME_S = 2.0
"""A request that has begun is complete, and an answer taken, within this time. Basis: a choice; a lost packet is repeated
within less."""
IN_USE_S = 1.0
"""A connection that has asked within this time is not closed for another one. Basis: a choice; controllers poll more often."""
MOST_WAITING_BYTES = 4096
"""Answers that may wait for a client, here and again in the system. Basis: a choice; a dozen, and a bound of the memory."""


class ModbusServer:
    """Answers every request with what is known at that moment."""

    def __init__(self, section: ModbusSection, snapshot: Callable[[], PlantSnapshot]) -> None:
        self._section, self._snapshot = section, snapshot
        self._used_s: dict[asyncio.StreamWriter, float] = {}
        """Connections, and when each has sent its last request."""
        self._is_full = False
        """Whether the log has said so since the last connection that was taken."""

    async def serve(self, started: Callable[[], None]) -> None:
        """Serve until cancelled; `started` is called when clients can connect. Raises `InputError`."""
        host, port = host_and_port(self._section.listen)
        try:
            server = await asyncio.start_server(self._accept, host, port, limit=MOST_WAITING_BYTES)
        except OSError as error:
            raise InputError(
                f"{self._section.listen} cannot be used ({error.strerror}); change modbus.listen"
            ) from error
        started()
        try:
            await server.serve_forever()
        finally:
            for connection in list(self._used_s):
                connection.transport.abort()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = writer.get_extra_info("peername")
        try:
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
