"""The page of a site: one card for each gateway, what asks for action first."""

import asyncio
import signal
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, get_args

from pydantic_core import to_json
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from gateway.fleet.gateway_status import FleetWord, GatewayStatus
from gateway.fleet.report import FleetReport
from gateway.messages import SCHEMA_VERSION
from gateway.page.guard import AllowedHosts, Guard
from gateway.page.http_server import HttpServer, static_routes
from gateway.page.hub import EventStream, event
from gateway.page.verdict import STYLES, VerdictStyle, Word

PUSH_S = 0.5
"""Interval between two pushes. Basis: a choice; a person overlooks a fleet, and states come once per second."""
MAX_PUSH_AGE_S = 1.5
"""A browser without a push for this time shows that its data are old. Basis: three pushes."""
CARD_STYLES: dict[FleetWord, VerdictStyle] = {
    **{word: STYLES[word] for word in get_args(Word)},
    "MISSING": VerdictStyle("MISSING", "black", "empty"),
    "GONE": VerdictStyle("GONE", "black", "hourglass"),
    "DUPLICATE": VerdictStyle("DUPLICATE", "violet", "slash"),
    "FAULT": VerdictStyle("FAULT", "amber", "triangle"),
    "BATTERY LOW": VerdictStyle("BATTERY LOW", "amber", "triangle"),
}


class FleetPage:
    """Serves the report of a fleet to browsers until it is stopped."""

    def __init__(
        self, look: Callable[[], FleetReport], listener: socket.socket, language: str, hosts: Sequence[str]
    ) -> None:
        """`look` returns the present report, what is most urgent first."""
        self._look = look
        self._listener = listener
        self._language = language
        self._hub = EventStream()
        routes = [
            *static_routes("fleet.html", language),
            Route("/healthz", self._healthz),
            Route("/api/fleet", self._fleet),
            Route("/api/events", self._events),
        ]
        guard = Guard(Starlette(routes=routes), AllowedHosts(listener.getsockname()[0], hosts), changing=())
        self._server = HttpServer(guard, self._hub)

    def run(self) -> None:
        """Serve until SIGINT or SIGTERM."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: self._server.stop())
        asyncio.run(self._server.serve_with(self._listener, lambda: asyncio.create_task(self._push_forever())))

    async def _push_forever(self) -> None:
        number = 0
        while True:
            number += 1
            self._hub.publish(event("state", self._content(), number=number))
            await asyncio.sleep(PUSH_S)

    def _content(self) -> dict[str, Any]:
        report = self._look()
        return {
            "schema_version": SCHEMA_VERSION,
            "now_s": round(time.monotonic(), 3),
            "connected": report.connected,
            "page": {"stale_s": MAX_PUSH_AGE_S, "language": self._language},
            "gateways": [_card(status) for status in report.listed],
        }

    async def _healthz(self, _request: Request) -> Response:
        connected = self._look().connected
        return Response(to_json({"ok": connected}), 200 if connected else 503, media_type="application/json")

    async def _fleet(self, _request: Request) -> Response:
        return Response(to_json(self._content()), media_type="application/json")

    async def _events(self, request: Request) -> Response:
        address = request.client.host if request.client else ""
        greeting = event("state", self._content(), number=0)
        return StreamingResponse(self._hub.stream(address, greeting), media_type="text/event-stream")


def _card(status: GatewayStatus) -> dict[str, Any]:
    """Return what the card of a gateway shows."""
    style = CARD_STYLES[status.state]
    site, crane, sensor = status.place
    return {
        "key": status.key,
        "site": site,
        "crane": crane,
        "sensor": sensor,
        "word": status.state,
        "colour": style.colour,
        "shape": style.shape,
        "reasons": status.reasons,
        "swing": None if status.swing is None else asdict(status.swing),
        "source": status.source,
        "authenticated": status.authenticated,
        "level": status.level,
        "alive": status.alive,
        "causes": asdict(status.causes),
        "seen_s": status.seen_s,
        "page": status.page,
    }
