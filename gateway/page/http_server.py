"""The HTTP server of a page with its events: uvicorn with limits, on a socket that is already bound."""

import asyncio
import logging
import socket
import time
from collections.abc import Callable

import uvicorn
from starlette.types import ASGIApp

from gateway.page.http_protocol import MAX_HEAD_BYTES, make_protocol
from gateway.page.hub import EventStream

LOG_INTERVAL_S = 10.0
"""Basis: a choice; a person who looks at a fault waits no longer."""
MAX_LINES_PER_INTERVAL = 5
"""Lines in an interval; the first of the next one says how many were left out. Basis: a choice; five show a pattern, and a flood
of requests fills no disk."""
ACCEPTED_AT_ONCE = 32
"""Connections that are accepted before the requests of those before are read. Basis: a sixth of `http_protocol.MAX_CONNECTIONS`;
with more, a flood would push a connection out before its request is read."""
WAITING_CONNECTIONS = 1024
"""Connections that the kernel keeps until they are accepted. Basis: a choice; half a second of a flood of 2000 per second. Where
there is no place, the browser's kernel tries again after 1, 3 and 7 s."""
HEADERS = [
    ("Content-Security-Policy", "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-store"),
]
"""The headers of every response. Nothing is cached, so that an old script never shows the data of an upgraded gateway."""
STALLED_MS = 5000
"""Time after which a connection that takes nothing ends. Basis: a choice; a radio link is back by then, and a dead one holds
memory no longer."""
SEND_BUFFER_BYTES = 32768
"""Basis: a choice; a few pushes, so that a stalled browser gets no old data."""


class LogRateLimiter(logging.Filter):
    """A limit on the lines that browsers can cause: passes `MAX_LINES_PER_INTERVAL` in each interval and counts the others."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now_s = now_s
        self._begin_s = now_s()
        self._lines = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is written."""
        now_s = self._now_s()
        if now_s - self._begin_s >= LOG_INTERVAL_S:
            left_out = max(self._lines - MAX_LINES_PER_INTERVAL, 0)
            self._begin_s, self._lines = now_s, 0
            if left_out:
                record.msg, record.args = f"{record.getMessage()} ({left_out} lines were left out)", ()
        self._lines += 1
        return self._lines <= MAX_LINES_PER_INTERVAL


class HttpServer(uvicorn.Server):
    """Ends the event streams before it stops, for it would wait for them without limit."""

    def __init__(self, application: ASGIApp, hub: EventStream) -> None:
        super().__init__(_settings(application))
        self._hub = hub

    async def serve_with(self, listener: socket.socket, work: Callable[[], "asyncio.Task[None]"]) -> None:
        """Serve until asked to stop; the task that `work` begins ends with the server, and the server with a failed task."""
        limit_stalled_browsers(listener)
        task = work()
        task.add_done_callback(lambda _: self.stop())
        await self.serve(sockets=[listener])
        if task.done():
            task.result()
        task.cancel()

    def stop(self) -> None:
        """Ask to end; the server checks ten times a second."""
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen; more connections may wait than are accepted at once."""
        await super().startup(sockets)
        for listener in sockets or ():
            listener.listen(WAITING_CONNECTIONS)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the streams, then the server."""
        self._hub.close()
        await super().shutdown(sockets)


def log_to_stderr(prefix: str) -> None:
    """Write warnings to standard error, as many lines as `LogRateLimiter` allows."""
    handler = logging.StreamHandler()
    handler.addFilter(LogRateLimiter())
    logging.basicConfig(level=logging.WARNING, format=f"{prefix}: %(message)s", handlers=[handler])


def limit_stalled_browsers(listener: socket.socket) -> None:
    """Bound what a browser that stops reading costs; accepted sockets inherit the options. Raises `OSError`."""
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, STALLED_MS)


def _settings(application: ASGIApp) -> uvicorn.Config:
    return uvicorn.Config(
        application,
        loop="asyncio",
        http=make_protocol(),
        h11_max_incomplete_event_size=MAX_HEAD_BYTES,
        ws="none",
        lifespan="off",
        backlog=ACCEPTED_AT_ONCE,
        log_config=None,
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        headers=HEADERS,
        workers=1,
        timeout_graceful_shutdown=1,
    )
