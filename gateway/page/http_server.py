"""The HTTP server of a page with its events and files: uvicorn on a socket that is already bound.

It has limits that uvicorn does not have: by address, and of the time until a request is complete.
"""

import asyncio
import json
import logging
import socket
import time
from collections.abc import Callable, Mapping
from functools import partial
from importlib import resources
from typing import Any

import uvicorn
from pydantic_core import to_json
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from gateway.languages import LANGUAGES, read_texts
from gateway.page.hub import ConnectionLimiter, EventStream

LOG_INTERVAL_S = 10.0
"""Basis: a choice; a person who looks at a fault waits no longer."""
MAX_LINES_PER_INTERVAL = 5
"""Lines in an interval; the first of the next one says how many were left out. Basis: a choice; five show a pattern, and a flood
of requests fills no disk."""
ACCEPTED_AT_ONCE = 32
"""Connections that are accepted before the requests of those before are read. Basis: a sixth of `MAX_CONNECTIONS`;
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
MAX_CONNECTIONS = 192
"""Basis: a choice; two for each of the `hub.MAX_STREAMS` streams, and a bound of the files."""
MAX_CONNECTIONS_PER_ADDRESS = 96
"""Basis: half of all, so that one address does not lock others out."""
REQUEST_S = 5.0
"""Longest time from the connection, or from the last response, until the head of a request is complete. Basis: a choice; a slow
link needs less, and an idle connection holds its place no longer."""
MAX_HEAD_BYTES = 16384
"""Largest head of a request, bytes. Basis: a choice; browsers with cookies send a few kilobytes."""
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


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


def make_protocol() -> type[H11Protocol]:
    """Return the protocol for `uvicorn.Config(http=...)`; its connections share one limit."""
    limiter: ConnectionLimiter[LimitedProtocol] = ConnectionLimiter(MAX_CONNECTIONS, MAX_CONNECTIONS_PER_ADDRESS)

    class Protocol(LimitedProtocol):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(limiter, *arguments, **options)

    return Protocol


class LimitedProtocol(H11Protocol):
    """One connection. While no request is answered it is idle, and may be ended."""

    def __init__(self, limiter: "ConnectionLimiter[LimitedProtocol]", *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._limiter = limiter
        self._deadline: asyncio.TimerHandle | None = None

    @property
    def address(self) -> str:
        """Address of the browser."""
        return self.client[0] if self.client else ""

    @property
    def idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def end(self) -> None:
        """End the connection at once."""
        self.transport.abort()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a place, and wait for a request."""
        super().connection_made(transport)
        if self._limiter.admit(self):
            self._set_deadline()
        else:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Give the place back."""
        self._limiter.release(self)
        self._clear_deadline()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take bytes; each does not prolong the time that the request has."""
        super().data_received(data)
        if not self.idle:
            self._clear_deadline()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        if not self.transport.is_closing() and self.idle:
            self._set_deadline()

    def _set_deadline(self) -> None:
        self._clear_deadline()
        self._deadline = self.loop.call_later(REQUEST_S, self._end_if_idle)

    def _clear_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _end_if_idle(self) -> None:
        if self.idle:
            self.end()


def static_routes(page: str, language: str) -> list[Route]:
    """Return the routes of all files, and of a module with the texts of a language; `page` is the one at `/`.

    `language` is that of a screen whose address names none: `/?lang=de`.
    """
    texts = {
        code: f"export const LANGUAGE = {json.dumps(code)}, TEXTS = {json.dumps(read_texts(code))};\n"
        for code in LANGUAGES
    }
    routes = [Route("/language.js", partial(_serve_texts, texts, language))]
    for file in resources.files("gateway.page").joinpath("static").iterdir():
        media_type = TYPES["." + file.name.rpartition(".")[2]]
        is_page = file.name.endswith(".html")
        if file.name == page or not is_page:
            path = "/" if is_page else f"/{file.name}"
            routes.append(Route(path, partial(_serve_file, file.read_bytes(), media_type)))
    return routes


def json_response(content: object, status: int = 200) -> Response:
    """Return a response in JSON; a number that is not finite becomes null, which every browser can read."""
    return Response(to_json(content, inf_nan_mode="null"), status, media_type="application/json")


async def _serve_texts(texts: Mapping[str, str], language: str, request: Request) -> Response:
    return Response(texts.get(request.query_params.get("lang", language), texts[language]), media_type=TYPES[".js"])


async def _serve_file(content: bytes, media_type: str, _request: Request) -> Response:
    return Response(content, media_type=media_type)
