"""The cranes of a site over HTTP: a page with one card for each gateway, what asks for action first, and the metrics of all.

The metrics are for gateways that a monitoring system cannot reach itself."""

import asyncio
import signal
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, get_args

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from gateway.bus.fleet_client import FleetClient
from gateway.fleet.fleet_state import FleetState
from gateway.fleet.gateway_status import STATE_LABELS, FleetWord, GatewayStatus
from gateway.fleet.report import FleetReport
from gateway.messages import SCHEMA_VERSION
from gateway.page.channel import place_of
from gateway.page.guard import AllowedHosts, Guard
from gateway.page.http_server import HttpServer, json_response, static_routes
from gateway.page.hub import EventStream, event
from gateway.page.metrics import (
    CONTENT_TYPE,
    Family,
    counter,
    gateway_families,
    gauge,
    labelled_gauge,
    render,
    with_labels,
)
from gateway.page.verdict import STYLES, PageEvidence, VerdictStyle, Word

PUSH_S = 0.5
"""Interval between two pushes. Basis: a choice; a person overlooks a fleet, and states come once per second."""
MAX_PUSH_AGE_S = 1.5
"""A browser without a push for this time shows that its data are old. Basis: three pushes."""
CARD_STYLES: dict[FleetWord, VerdictStyle] = {
    **{word: STYLES[word] for word in get_args(Word)},
    "MISSING": VerdictStyle("MISSING", "grey", "empty"),
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
        return json_response({"ok": connected}, 200 if connected else 503)

    async def _fleet(self, _request: Request) -> Response:
        return json_response(self._content())

    async def _events(self, request: Request) -> Response:
        address = request.client.host if request.client else ""
        events = self._hub.stream(address, lambda: event("state", self._content(), number=0))
        return StreamingResponse(events, media_type="text/event-stream")


def _card(status: GatewayStatus) -> dict[str, Any]:
    """Return what the card of a gateway shows."""
    style = CARD_STYLES[status.state]
    return {
        "key": status.key,
        **place_of(status.key),
        "word": status.state,
        "colour": style.colour,
        "shape": style.shape,
        "reasons": status.reasons,
        "last_alarm": status.last_alarm,
        "swing": None if status.swing is None else asdict(status.swing),
        "motion": None if status.motion is None else asdict(status.motion),
        "source": status.source,
        "authenticated": status.authenticated,
        "level": status.level,
        "alive": status.alive,
        "causes": asdict(status.causes),
        "seen_s": status.seen_s,
        "page": status.page,
    }


def format_fleet(
    evidence: Mapping[str, PageEvidence], statuses: Sequence[GatewayStatus], *, connected: bool, invalid: int
) -> str:
    """Return the metrics of every gateway with site, crane and sensor as labels, and those of the fleet."""
    return render([*_gateways(evidence), *_fleet(statuses, connected=connected, invalid=invalid)])


def _gateways(evidence: Mapping[str, PageEvidence]) -> Iterator[Family]:
    for key, each in evidence.items():
        yield from with_labels(gateway_families(each), place_of(key))


def _fleet(statuses: Sequence[GatewayStatus], *, connected: bool, invalid: int) -> Iterator[Family]:
    counts = Counter(status.state for status in statuses)
    by_state = {label: counts[word] for word, label in STATE_LABELS.items()}
    yield labelled_gauge("fleet_gateways", "state", "Gateways by state.", by_state)
    for status in statuses:
        if status.state == "MISSING":
            missing = gauge("fleet_gateway_missing", "1 for an expected gateway that was never seen.", 1)
            yield from with_labels([missing], place_of(status.key))
    yield gauge("fleet_router_connected", "1 while the router is connected.", connected)
    yield counter("fleet_invalid_messages", "Messages that were dropped because they were invalid.", invalid)


def make_exporter(client: FleetClient, state: FleetState, hosts: list[str]) -> Starlette:
    """Make the routes of the metrics; `hosts` are the names under which the exporter may be asked."""

    async def metrics(_request: Request) -> Response:
        state.receive(client.receive())
        now_s = time.monotonic()
        text = format_fleet(
            state.evidence(now_s),
            state.statuses(now_s, datetime.now(UTC)),
            connected=client.connected,
            invalid=state.invalid + client.inbox.refused,
        )
        return Response(text, media_type=CONTENT_TYPE)

    guard = Middleware(TrustedHostMiddleware, allowed_hosts=hosts)
    return Starlette(routes=[Route("/metrics", metrics)], middleware=[guard])
