"""The routes of the page: its files, its state, and the actions of people who have entered the PIN."""

import time
from functools import partial
from importlib import resources

from pydantic_core import to_json
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from gateway.page import exposition, metrics
from gateway.page.actions import Actions
from gateway.page.guard import Guard
from gateway.page.hosts import AllowedHosts
from gateway.page.hub import EventStream, event
from gateway.page.state import PageState

STATIC = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
HEADERS = [
    ("Content-Security-Policy", "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-store"),
]
"""The headers of every response. Nothing is cached, so that an old script never shows the data of an upgraded gateway."""


def make_application(state: PageState, hub: EventStream, actions: Actions, hosts: AllowedHosts) -> Guard:
    """Make the routes. All endpoints are coroutines, so they run in the one thread of the state."""

    async def healthz(_request: Request) -> Response:
        judged = state.verdict(time.monotonic())
        well = judged.word not in ("NO DATA", "STALE")
        return _json({"ok": well, "verdict": judged.word, "reasons": judged.reasons}, 200 if well else 503)

    async def api_state(_request: Request) -> Response:
        return _json(state.snapshot(time.monotonic()))

    async def api_events(request: Request) -> Response:
        address = request.client.host if request.client else ""
        now_s = time.monotonic()
        history = {"points": state.history.rows(since=0, now_s=now_s)}
        greeting = event("history", history, number=0) + event("state", state.summary(now_s), number=0)
        return StreamingResponse(hub.stream(address, greeting), media_type="text/event-stream")

    async def prometheus(_request: Request) -> Response:
        counters = metrics.Counters(
            received=state.received,
            invalid=state.invalid,
            clients=len(hub),
            dropped_clients=hub.dropped,
        )
        text = metrics.format_exposition(state.evidence(time.monotonic()), counters, state.parameters.place)
        return Response(text, media_type=exposition.CONTENT_TYPE)

    endpoints = {"/healthz": healthz, "/api/state": api_state, "/api/events": api_events, "/metrics": prometheus}
    reading = (Route(path, endpoint) for path, endpoint in endpoints.items())
    changing = actions.changing_routes()
    routes = [*_static_routes(), *reading, *actions.reading_routes(), *changing]
    return Guard(Starlette(routes=routes), hosts, {route.path for route in changing})


def _json(content: object, status: int = 200) -> Response:
    return Response(to_json(content, inf_nan_mode="null"), status, media_type="application/json")


def _static_routes() -> list[Route]:
    routes = []
    for file in resources.files("gateway.page").joinpath("static").iterdir():
        media_type = STATIC["." + file.name.rpartition(".")[2]]
        path = "/" if file.name == "index.html" else f"/{file.name}"
        routes.append(Route(path, partial(_serve_file, file.read_bytes(), media_type)))
    return routes


async def _serve_file(content: bytes, media_type: str, _request: Request) -> Response:
    return Response(content, media_type=media_type)
