"""What every request passes before an endpoint: the host, and for changes the origin, the type and the size."""

import asyncio
import ipaddress
from collections.abc import Collection, Sequence
from typing import Any
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

LOOPBACK = ("localhost", "127.0.0.1", "::1")
MAX_BODY_BYTES = 2048
"""Largest body of a request, bytes. Basis: a choice; an acknowledgement has some hundred bytes."""
BODY_S = 5.0
"""Longest time for a body. Basis: as for the head, `http_server.REQUEST_S`."""


class AllowedHosts:
    """The Host headers that are answered: loopback, the address of `page.listen`, and the names of `page.hosts`.

    So no other site can read the page by DNS rebinding.
    Where the page listens at all addresses, every address is allowed and no name: rebinding needs a name.
    """

    def __init__(self, listen_host: str, names: Sequence[str] = ()) -> None:
        self._names = {name.lower() for name in (*LOOPBACK, listen_host, *names)}
        self._any_address = _is_unspecified(listen_host)

    def allows(self, host_header: str) -> bool:
        """Return whether a Host header is allowed; its port does not matter."""
        try:
            name = urlsplit(f"//{host_header}").hostname
        except ValueError:
            return False
        if not name or "@" in host_header or "/" in host_header:
            return False
        return name in self._names or (self._any_address and _is_address(name))


def is_same_origin(origin: str, host_header: str) -> bool:
    """Return whether the Origin header of a browser names the host that it asks."""
    return origin in (f"http://{host_header}", f"https://{host_header}")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_unspecified(host: str) -> bool:
    return _is_address(host) and ipaddress.ip_address(host).is_unspecified


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
