"""HTTP connections with limits that uvicorn does not have: by address, and of the time until a request is complete."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from gateway.page.connection_limiter import ConnectionLimiter

MAX_CONNECTIONS = 192
"""Basis: a choice; two for each of the `hub.MAX_STREAMS` streams, and a bound of the files."""
MAX_CONNECTIONS_PER_ADDRESS = 96
"""Basis: half of all, so that one address does not lock others out."""
REQUEST_S = 5.0
"""Longest time from the connection, or from the last response, until the head of a request is complete. Basis: a choice; a slow
link needs less, and an idle connection holds its place no longer."""
MAX_HEAD_BYTES = 16384
"""Largest head of a request, bytes. Basis: a choice; browsers with cookies send a few kilobytes."""


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
