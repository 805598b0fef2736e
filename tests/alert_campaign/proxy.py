"""A wire between receivers and the router that delays, stalls, resets (TCP), loses, repeats and reorders (UDP).

Arguments: listening address, router's address, both HOST:PORT. Commands on standard input, one line each: `NAME VALUE`.
"""

import asyncio
import os
import random
import socket
import sys
from contextlib import suppress
from typing import cast

CHUNK = 16384


class Wire:
    """The present faults."""

    delay_s = 0.0
    stalled = False
    loss = 0.0
    repeat = 0.0
    reorder = 0.0

    def __init__(self) -> None:
        self.connections: set[asyncio.StreamWriter] = set()

    def read_commands(self) -> None:
        """Read what has come on standard input."""
        for line in os.read(0, 4096).decode().splitlines():
            self.command(line)

    def command(self, line: str) -> None:
        """Change a fault: delay_s, stalled, loss, repeat, reorder; or reset all connections."""
        name, value = line.split()
        if name == "reset":
            for writer in list(self.connections):
                with suppress(OSError):
                    writer.transport.abort()
        else:
            setattr(self, name, float(value))


async def pipe(wire: Wire, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Forward one direction of a TCP connection."""
    with suppress(OSError, asyncio.CancelledError):
        while chunk := await reader.read(CHUNK):
            await asyncio.sleep(wire.delay_s)
            while wire.stalled:
                await asyncio.sleep(0.02)
            writer.write(chunk)
            await writer.drain()
    writer.transport.abort()


async def forward(wire: Wire, listen: tuple[str, int], router: tuple[str, int]) -> None:
    """Accept TCP connections until the end."""

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            far_reader, far_writer = await asyncio.open_connection(*router)
        except OSError:
            writer.transport.abort()
            return
        wire.connections |= {writer, far_writer}
        await asyncio.gather(pipe(wire, reader, far_writer), pipe(wire, far_reader, writer))
        wire.connections -= {writer, far_writer}

    server = await asyncio.start_server(accept, *listen)
    await server.serve_forever()


class Datagrams(asyncio.DatagramProtocol):
    """One UDP endpoint of the wire; `far` sends what it receives."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.far: Datagrams | None = None
        self.peer: tuple[str, int] | None = None
        self.transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport."""
        self.transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Pass a datagram on, by the present faults."""
        self.peer = addr
        wire = self.wire
        if self.far is None or wire.stalled or random.random() < wire.loss:
            return
        copies = 2 if random.random() < wire.repeat else 1
        for _ in range(copies):
            late_s = random.uniform(0.0, 0.05) if random.random() < wire.reorder else 0.0
            asyncio.get_running_loop().call_later(wire.delay_s + late_s, self.far.send, data)

    def error_received(self, exc: Exception) -> None:
        """Ignore that nobody listens: the router is down."""

    def send(self, data: bytes) -> None:
        """Send a datagram to the last peer."""
        if self.transport is not None and self.peer is not None:
            self.transport.sendto(data, self.peer)


async def main() -> None:
    """Forward until killed."""
    wire = Wire()
    (host, port), (far_host, far_port) = (text.rsplit(":", 1) for text in sys.argv[1:3])
    loop = asyncio.get_running_loop()
    _, near = await loop.create_datagram_endpoint(lambda: Datagrams(wire), local_addr=(host, int(port)))
    _, far = await loop.create_datagram_endpoint(lambda: Datagrams(wire), local_addr=(host, 0), family=socket.AF_INET)
    near.far, far.far = far, near
    far.peer = (far_host, int(far_port))
    loop.add_reader(0, wire.read_commands)
    await forward(wire, (host, int(port)), (far_host, int(far_port)))


asyncio.run(main())
