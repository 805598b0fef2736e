"""The page process: receives from its gateway and serves HTTP until the channel ends or a signal comes.

Its routes are the page's files, its state, and the actions of people who have entered the PIN.
"""

import asyncio
import os
import signal
import socket
import sys
import time
from collections.abc import Mapping
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from gateway.page import metrics
from gateway.page.actions import Actions, GatewayRequests
from gateway.page.channel import ANSWER, PARAMETERS, Frame, Parameters, parse_parameters, receive_frame
from gateway.page.guard import AllowedHosts, Guard
from gateway.page.history import History
from gateway.page.http_server import HttpServer, json_response, log_to_stderr, static_routes
from gateway.page.hub import EventStream, event
from gateway.page.state import PageState

PUSH_INTERVAL_S = 0.04
"""Shortest interval between two pushes. Basis: motion comes at 10 Hz, so that a message seldom waits for it."""
MAX_PUSH_INTERVAL_S = 0.25
"""Longest interval between two pushes. Silence shows a browser that the page has ended. Basis: a browser calls the data old after
1 to 1.5 s (`link.js`): four pushes or more."""
GATHER_S = 0.01
"""Short wait that joins the messages of one block into one push. Basis: a choice; a block's messages come within milliseconds,
and 10 ms are not seen."""
SELDOM_CHANGED = ("alert_log", "page")
"""Parts of the state that a push has only where they have changed; the list of alerts is by far the largest."""
MAX_INDEX_DIGITS = 12
"""Of a number that a browser sends. Basis: a choice; more points than come in the life of a computer."""
MAX_FRAMES_AT_ONCE = 256
"""Frames that are taken before browsers are served again. Basis: a choice; more than come between two pushes, and no browser
waits for a flood."""


def make_application(state: PageState, hub: EventStream, actions: Actions, hosts: AllowedHosts) -> Guard:
    """Make the routes. All endpoints are coroutines, so they run in the one thread of the state."""

    async def healthz(_request: Request) -> Response:
        judged = state.verdict(time.monotonic())
        well = judged.word not in ("NO DATA", "STALE")
        return json_response({"ok": well, "verdict": judged.word, "reasons": judged.reasons}, 200 if well else 503)

    async def api_state(_request: Request) -> Response:
        return json_response(state.snapshot(time.monotonic()))

    async def api_events(request: Request) -> Response:
        address = request.client.host if request.client else ""

        def greet() -> bytes:
            now_s = time.monotonic()
            missing = state.history.rows(since=_first_missing(state.history, request.query_params), now_s=now_s)
            history = {"id": state.history.id, "points": missing}
            return event("state", state.summary(now_s), number=0) + event("history", history, number=0)

        return StreamingResponse(hub.stream(address, greet), media_type="text/event-stream")

    async def prometheus(_request: Request) -> Response:
        counters = metrics.Counters(
            received=state.received,
            invalid=state.invalid,
            clients=len(hub),
            dropped_clients=hub.dropped,
        )
        text = metrics.format_exposition(state.evidence(time.monotonic()), counters, state.parameters.place)
        return Response(text, media_type=metrics.CONTENT_TYPE)

    endpoints = {"/healthz": healthz, "/api/state": api_state, "/api/events": api_events, "/metrics": prometheus}
    reading = (Route(path, endpoint) for path, endpoint in endpoints.items())
    changing = actions.changing_routes()
    routes = [*static_routes("index.html", state.parameters.language), *reading, *actions.reading_routes(), *changing]
    return Guard(Starlette(routes=routes), hosts, {route.path for route in changing})


def main() -> int:
    """Receive the start parameters and serve. Return 0 when asked to end, 2 for wrong start parameters."""
    log_to_stderr("page")
    try:
        channel = socket.socket(fileno=os.dup(sys.stdin.fileno()))
        parameters = _receive_parameters(channel)
        listener = _inherit_socket(parameters.fd)
    except (ValueError, OSError) as error:
        print(f"page: start parameters on standard input: {error}", file=sys.stderr)
        return 2
    state, hub = PageState(parameters), EventStream()
    page = Page(state, hub, channel, listener)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: page.stop())
    asyncio.run(page.serve())
    return 0


class Page:
    """Connects channel, state and browsers."""

    def __init__(self, state: PageState, hub: EventStream, channel: socket.socket, listener: socket.socket) -> None:
        self._state = state
        self._hub = hub
        self._channel = channel
        self._listener = listener
        self._requests = GatewayRequests(channel)
        host, port = listener.getsockname()[:2]
        hosts = AllowedHosts(host, state.parameters.hosts)
        application = make_application(state, hub, Actions(state, self._requests, port), hosts)
        self._server = HttpServer(application, hub)
        self._news = asyncio.Event()

    async def serve(self) -> None:
        """Serve until `stop` is called or the channel ends."""
        loop = asyncio.get_running_loop()
        self._channel.setblocking(False)
        loop.add_reader(self._channel, self._receive)
        try:
            await self._server.serve_with(self._listener, lambda: asyncio.create_task(self._push_forever()))
        finally:
            loop.remove_reader(self._channel)

    def stop(self) -> None:
        """Ask to end."""
        self._server.stop()

    def _receive(self) -> None:
        """Take what has come through the channel, and end with it."""
        frames: list[Frame] = []
        try:
            while len(frames) < MAX_FRAMES_AT_ONCE:
                frame = receive_frame(self._channel)
                if frame is None:
                    self._end_with_gateway()
                    break
                if frame.kind == ANSWER:
                    self._requests.receive(frame.payload)
                else:
                    frames.append(frame)
        except BlockingIOError:
            pass
        except ConnectionError:
            self._end_with_gateway()
        self._state.receive(frames)
        self._news.set()

    def _end_with_gateway(self) -> None:
        asyncio.get_running_loop().remove_reader(self._channel)
        self.stop()

    async def _push_forever(self) -> None:
        shown, number = 0, 0
        before: dict[str, Any] = {}
        while True:
            await self._wait_for_news()
            now_s = time.monotonic()
            self._state.tick(now_s)
            if len(self._hub):
                number += 1
                points = self._state.history.rows(since=shown, now_s=now_s)
                present = self._state.summary(now_s)
                self._hub.publish(event("change", {**changes(before, present), "points": points}, number=number))
                before = present
            else:
                before = {}
            shown = self._state.history.next_index
            await asyncio.sleep(PUSH_INTERVAL_S - GATHER_S)

    async def _wait_for_news(self) -> None:
        try:
            async with asyncio.timeout(MAX_PUSH_INTERVAL_S - PUSH_INTERVAL_S):
                await self._news.wait()
        except TimeoutError:
            return
        await asyncio.sleep(GATHER_S)
        self._news.clear()


def changes(before: Mapping[str, Any], present: Mapping[str, Any]) -> dict[str, Any]:
    """Return a state without what has not changed since the push before: messages, and the parts that seldom do.

    A browser that came in between was greeted with a state as new: no part takes an earlier value again between two pushes.
    """
    shown = before.get("topics", {})
    topics = {name: message for name, message in present["topics"].items() if message != shown.get(name)}
    kept = [key for key in SELDOM_CHANGED if key in before and before[key] == present[key]]
    return {**{key: value for key, value in present.items() if key not in kept}, "topics": topics}


def _first_missing(history: History, query: Mapping[str, str]) -> int:
    """Return the index of the first point that a browser has not got; 0 where it has none of this history."""
    after = query.get("after", "")
    is_known = query.get("history") == history.id and after.isdecimal()
    return int(after) + 1 if is_known and len(after) <= MAX_INDEX_DIGITS else 0


def _receive_parameters(channel: socket.socket) -> Parameters:
    frame = receive_frame(channel)
    if frame is None or frame.kind != PARAMETERS:
        raise ValueError("no parameters from the gateway")
    return parse_parameters(frame.payload)


def _inherit_socket(fd: int) -> socket.socket:
    try:
        return socket.socket(fileno=fd)
    except OSError as error:
        raise ValueError(f"fd: {fd} is not a socket: {error.strerror}") from None
