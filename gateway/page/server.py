"""The page process: receives from Zenoh and serves HTTP until standard input closes or a signal comes."""

import asyncio
import logging
import os
import signal
import socket
import sys
import time

import uvicorn

from gateway.bus.session import BusError, session_settings
from gateway.page.application import HEADERS, make_application
from gateway.page.hub import EventStream, event
from gateway.page.inbox import Inbox
from gateway.page.link import Link
from gateway.page.parameters import LONGEST_LINE, parse
from gateway.page.state import PageState

PUSH_INTERVAL_S = 0.1
HEARTBEAT_S = 0.25
"""Longest interval between two pushes. Silence shows a browser that the page has ended."""
GATHER_S = 0.01
"""Short wait that joins the messages of one block into one push."""
STALLED_MS = 5000
SEND_BUFFER_BYTES = 32768
MOST_CONNECTIONS = 128

log = logging.getLogger("page")


def main() -> int:
    """Read the start line and serve. Return 0 when asked to end, 1 when the bus failed, 2 for wrong start parameters."""
    logging.basicConfig(level=logging.WARNING, format="page: %(message)s")
    try:
        parameters = parse(_read_line(sys.stdin.fileno()))
        settings = session_settings("client", parameters.connect, [])
        listener = _inherit_socket(parameters.fd)
    except (ValueError, BusError) as error:
        print(f"page: start parameters on standard input: {error}", file=sys.stderr)
        return 2
    state, hub = PageState(parameters), EventStream()
    page = Page(state, hub)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: page.stop())
    link = Link(settings, parameters.key, page.inbox, page.fail)
    return asyncio.run(page.serve(link, listener))


class _UvicornServer(uvicorn.Server):
    """Ends the event streams before it stops, for it would wait for them without limit."""

    def __init__(self, config: uvicorn.Config, hub: EventStream) -> None:
        super().__init__(config)
        self._hub = hub

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._hub.close()
        await super().shutdown(sockets)


class Page:
    """Connects inbox, state and browsers."""

    def __init__(self, state: PageState, hub: EventStream) -> None:
        self.inbox = Inbox(self._wake)
        self._state = state
        self._hub = hub
        self._server = _UvicornServer(_http_settings(make_application(state, hub, self.inbox)), hub)
        self._news = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._exit_code = 0

    async def serve(self, link: Link, listener: socket.socket) -> int:
        """Serve until `stop` is called; return the exit code."""
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sys.stdin.fileno(), self._check_parent)
        link.start()
        pushing = asyncio.create_task(self._push_forever())
        pushing.add_done_callback(lambda _: self.stop())
        try:
            await self._server.serve(sockets=[listener])
        finally:
            link.close()
            self._loop.remove_reader(sys.stdin.fileno())
        if pushing.done():
            pushing.result()
        pushing.cancel()
        return self._exit_code

    def stop(self) -> None:
        """Ask to end; the server checks ten times a second."""
        self._server.should_exit = True

    def fail(self, text: str) -> None:
        """End because the bus cannot be used. Called from any thread."""
        log.error("Zenoh: %s", text)
        self._exit_code = 1
        self.stop()

    def _wake(self) -> None:
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._receive_inbox)

    def _receive_inbox(self) -> None:
        self._state.receive(self.inbox.drain())
        self._news.set()

    def _check_parent(self) -> None:
        if not os.read(sys.stdin.fileno(), LONGEST_LINE):
            self.stop()

    async def _push_forever(self) -> None:
        shown, number = 0, 0
        while True:
            await self._wait_for_news()
            now_s = time.monotonic()
            self._state.tick(now_s)
            if len(self._hub):
                number += 1
                points = self._state.history.rows(since=shown, now_s=now_s)
                self._hub.publish(event("state", {**self._state.summary(now_s), "points": points}, number=number))
            shown = self._state.history.next_index
            await asyncio.sleep(PUSH_INTERVAL_S - GATHER_S)

    async def _wait_for_news(self) -> None:
        try:
            async with asyncio.timeout(HEARTBEAT_S - PUSH_INTERVAL_S):
                await self._news.wait()
        except TimeoutError:
            return
        await asyncio.sleep(GATHER_S)
        self._news.clear()


def _http_settings(app: object) -> uvicorn.Config:
    return uvicorn.Config(
        app,  # type: ignore[arg-type]
        loop="asyncio",
        http="h11",
        ws="none",
        lifespan="off",
        log_config=None,
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        headers=HEADERS,
        workers=1,
        limit_concurrency=MOST_CONNECTIONS,
        timeout_graceful_shutdown=1,
    )


def _read_line(fd: int) -> bytes:
    """Read one line without buffering, so that standard input can be watched for its end."""
    line = b""
    while not line.endswith(b"\n"):
        read = os.read(fd, 1)
        if not read or len(line) > LONGEST_LINE:
            raise ValueError("one JSON line expected")
        line += read
    return line


def _inherit_socket(fd: int) -> socket.socket:
    """Return the inherited listening socket; accepted sockets inherit its options."""
    try:
        listener = socket.socket(fileno=fd)
    except OSError as error:
        raise ValueError(f"fd: {fd} is not a socket: {error.strerror}") from None
    # A browser that stops reading costs at most this buffer and is disconnected by the kernel.
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, STALLED_MS)
    return listener
