"""What every request passes before an endpoint: the host, and for changes the origin, the type and the size."""

import asyncio
from collections.abc import Collection
from typing import Any

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from gateway.page.hosts import AllowedHosts, is_same_origin

MAX_BODY_BYTES = 2048
"""Largest body of a request, bytes. Basis: a choice; an acknowledgement has some hundred bytes."""
BODY_S = 5.0
"""Longest time for a body. Basis: as for the head, `http_protocol.REQUEST_S`."""


class Guard:
    """Refuses requests for foreign hosts, and changes that do not come from a script of this page."""

    def __init__(self, app: ASGIApp, hosts: AllowedHosts, changing: Collection[str]) -> None:
        """`changing` are the paths of the endpoints that change something."""
        self._app = app
        self._hosts = hosts
        self._changing = changing

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request that is refused; pass others on."""
        refusal = None if scope["type"] != "http" else self._refusal(scope, Headers(scope=scope))
        if refusal is None:
            await self._app(scope, receive, send)
        else:
            status, text = refusal
            await PlainTextResponse(f"{text}\n", status)(scope, receive, send)

    def _refusal(self, scope: Scope, headers: Headers) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if len(headers.getlist("host")) != 1 or not self._hosts.allows(host):
            return 421, "this host is not served here; name it in page.hosts"
        if scope["path"] not in self._changing:
            return None
        if not is_same_origin(headers.get("origin", ""), host):
            return 403, "changes are made on the page itself"
        if headers.get("content-type", "").partition(";")[0].strip() != "application/json":
            return 415, "application/json expected"
        return None


class BodyError(ValueError):
    """A body is too large, too slow or cut."""


async def read_body(request: Request) -> bytes:
    """Read the body of a request within bounds. Raises `BodyError`."""
    body = b""
    stream: Any = request.stream()
    try:
        async with asyncio.timeout(BODY_S):
            async for chunk in stream:
                body += chunk
                if len(body) > MAX_BODY_BYTES:
                    raise BodyError("the request is too large")
    except (TimeoutError, ClientDisconnect):
        raise BodyError("the request is not complete") from None
    return body
