"""The routes of the page: its files, its state, and the actions of people who have entered the PIN."""

import time

from pydantic_core import to_json
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from gateway.page import exposition, metrics
from gateway.page.actions import Actions
from gateway.page.guard import AllowedHosts, Guard
from gateway.page.hub import EventStream, event
from gateway.page.state import PageState
from gateway.page.static_files import static_routes


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
    routes = [*static_routes("index.html", state.parameters.language), *reading, *actions.reading_routes(), *changing]
    return Guard(Starlette(routes=routes), hosts, {route.path for route in changing})


def _json(content: object, status: int = 200) -> Response:
    return Response(to_json(content, inf_nan_mode="null"), status, media_type="application/json")
