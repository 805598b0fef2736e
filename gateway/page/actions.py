"""What a person can do on the page: sign in with name and PIN, acknowledge alarms, sign out; and how the gateway is asked."""

import asyncio
import itertools
import logging
import secrets
import socket
import time
from collections.abc import Callable
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import to_json
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from gateway.page.channel import REPORT, REQUEST, Frame, encode_frame
from gateway.page.guard import BodyError, read_body
from gateway.page.http_server import json_response
from gateway.page.sign_in import PinState, SignedInPerson, SignIn, SignInReport, read_pin, replace_pin
from gateway.page.state import PageState

log = logging.getLogger("page")
Name = Annotated[
    str, Field(min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f\u2028\u2029]*\S[^\x00-\x1f\x7f\u2028\u2029]*$")
]
REPLACING_PAUSE_S = 5.0
"""Pause between two attempts to write a new PIN. Basis: a choice; a disk that is mended is used within what a person waits."""
REPORT_INTERVAL_S = 1.0
"""Shortest time between two reports, so that a flood of wrong PINs costs the gateway nothing. Basis: a choice; the gateway's
health comes as often."""
Content = TypeVar("Content", bound=BaseModel)
MAX_GATEWAY_ANSWER_S = 6.0
"""Longest wait for an answer. Basis: the gateway answers within 4 s, and the browser waits for 10 s (`post.js`)."""
MAX_WAITING_REQUESTS = 8
"""Requests that may wait. Basis: a choice; persons ask one by one, and half of what the gateway queues."""


class GatewayAnswer(BaseModel):
    """The answer to a request."""

    number: int | None = None
    accepted: bool
    text: Annotated[str, Field(max_length=2000)] = ""


class GatewayRequests:
    """Sends requests and finds the answer to each; used by the page's one thread."""

    def __init__(self, channel: socket.socket) -> None:
        self._channel = channel
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[GatewayAnswer]] = {}

    async def submit(self, verb: str, request: dict[str, object]) -> GatewayAnswer:
        """Send a request and wait for its answer; without one in time it says so."""
        if len(self._waiting) >= MAX_WAITING_REQUESTS:
            return GatewayAnswer(accepted=False, text="too many requests are waiting")
        number = next(self._numbers)
        payload = to_json({"number": number, "verb": verb, "payload": to_json(request).decode()})
        answer: asyncio.Future[GatewayAnswer] = asyncio.get_running_loop().create_future()
        self._waiting[number] = answer
        try:
            self._channel.send(encode_frame(Frame(REQUEST, time.monotonic(), payload)))
            async with asyncio.timeout(MAX_GATEWAY_ANSWER_S):
                return await answer
        except (OSError, TimeoutError):
            return GatewayAnswer(accepted=False, text="the gateway does not answer")
        finally:
            self._waiting.pop(number, None)

    def report(self, payload: bytes) -> bool:
        """Send what needs no answer; return False where the gateway does not take it now."""
        try:
            self._channel.send(encode_frame(Frame(REPORT, time.monotonic(), payload)))
        except OSError:
            return False
        return True

    def receive(self, payload: bytes) -> None:
        """Take an answer; one that nobody waits for is forgotten."""
        try:
            answer = GatewayAnswer.model_validate_json(payload)
        except ValidationError:
            return
        waiting = None if answer.number is None else self._waiting.get(answer.number)
        if waiting is not None and not waiting.done():
            waiting.set_result(answer)


class SignInContent(BaseModel):
    """Name and PIN as they were entered."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name
    pin: Annotated[str, Field(max_length=64)]


class AcknowledgeContent(BaseModel):
    """The incident that is acknowledged."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    incident: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,64}$")]


class Actions:
    """The endpoints of the actions. Answers carry the key of a text of the page, never a secret."""

    def __init__(self, state: PageState, gateway: GatewayRequests, port: int) -> None:
        """`port` distinguishes the cookies of several pages of one host: browsers do not."""
        self._state = state
        self._gateway = gateway
        self._sign_in = SignIn()
        self._reporter = SignInReporter(gateway.report)
        self._replacing: asyncio.Task[None] | None = None
        self._cookie = f"plumbline_{port}"

    def reading_routes(self) -> list[Route]:
        """Return the routes that change nothing."""
        return [Route("/api/session", self._get_session)]

    def changing_routes(self) -> list[Route]:
        """Return the routes that change something, which the guard watches."""
        return [
            Route("/api/sign-in", self._post_sign_in, methods=["POST"]),
            Route("/api/sign-out", self._post_sign_out, methods=["POST"]),
            Route("/api/acknowledge", self._post_acknowledge, methods=["POST"]),
        ]

    def _people(self) -> SignIn:
        """Return who is signed in by the PIN that the file has now."""
        self._sign_in.use(read_pin(self._state.parameters.pin_file))
        return self._sign_in

    def _session(self, request: Request) -> SignedInPerson | None:
        return self._people().session(self._token(request), time.monotonic())

    def _token(self, request: Request) -> str | None:
        return request.cookies.get(self._cookie)

    async def _get_session(self, request: Request) -> Response:
        session = self._session(request)
        return _answer(200, name=None if session is None else session.name, available=self._sign_in.is_possible)

    async def _post_sign_in(self, request: Request) -> Response:
        content = await _read(request, SignInContent)
        if isinstance(content, Response):
            return content
        people = self._people()
        if not people.is_possible:
            return _answer(503, error="no_pin" if people.successor is None else "pin_void")
        token = people.sign_in(content.name.strip(), content.pin.strip(), time.monotonic())
        if token is None:
            address = request.client.host if request.client else ""
            log.warning("a wrong PIN was entered at %s", address)
            self._reporter.note_wrong(address)
            if people.successor is not None:
                self._replacing = asyncio.create_task(self._replace_pin(people.successor))
            return _answer(403, error="pin_wrong")
        self._reporter.note_pin("good")
        response = _answer(200, name=content.name.strip())
        response.set_cookie(self._cookie, token, httponly=True, samesite="strict")
        return response

    async def _replace_pin(self, pin: str) -> None:
        """Write the PIN that takes the place of a void one, as soon as the disk takes it."""
        path, reported = self._state.parameters.pin_file, False
        while path is not None and self._sign_in.successor == pin:
            try:
                await asyncio.to_thread(replace_pin, path, pin)
            except OSError:
                if not reported:
                    self._reporter.note_pin("void")
                reported = True
                await asyncio.sleep(REPLACING_PAUSE_S)
            else:
                self._reporter.note_pin("replaced")
                return

    async def _post_sign_out(self, request: Request) -> Response:
        self._sign_in.sign_out(self._token(request))
        response = _answer(200, name=None)
        response.delete_cookie(self._cookie, httponly=True, samesite="strict")
        return response

    async def _post_acknowledge(self, request: Request) -> Response:
        session = self._session(request)
        if session is None:
            return _answer(401, error="sign_in_first")
        content = await _read(request, AcknowledgeContent)
        if isinstance(content, Response):
            return content
        answer = await self._gateway.submit(
            "acknowledge", {"id": f"page-{secrets.token_hex(8)}", "by": session.name, "incident": content.incident}
        )
        if answer.accepted:
            self._people().note_use(self._token(request), time.monotonic())
        return _answer(200 if answer.accepted else 409, accepted=answer.accepted, text=answer.text)


async def _read(request: Request, model: type[Content]) -> Content | Response:
    """Return the content of a request, or the answer to one that is not valid."""
    try:
        return model.model_validate_json(await read_body(request))
    except BodyError:
        return _answer(413, error="request_invalid")
    except ValidationError:
        return _answer(400, error="request_invalid")


def _answer(status: int, **content: object) -> Response:
    return json_response(content, status)


class SignInReporter:
    """Merges what happens within a second into one report; used by the page's one thread."""

    def __init__(self, send: Callable[[bytes], bool]) -> None:
        """`send` returns False where the gateway does not take the report now."""
        self._send = send
        self._wrong, self._address = 0, ""
        self._pin: PinState | None = None
        self._timer: asyncio.TimerHandle | None = None

    def note_wrong(self, address: str) -> None:
        """Note a wrong PIN."""
        self._wrong += 1
        self._address = address
        self._report_soon()

    def note_pin(self, pin: PinState) -> None:
        """Note what became of the PIN."""
        self._pin = pin
        self._report_soon()

    def _report_soon(self) -> None:
        if self._timer is None:
            self._report()

    def _report(self) -> None:
        self._timer = None
        if self._wrong == 0 and self._pin is None:
            return
        report = SignInReport(wrong=self._wrong, address=self._address, pin=self._pin)
        if self._send(to_json(report)):
            self._wrong, self._pin = 0, None
        self._timer = asyncio.get_running_loop().call_later(REPORT_INTERVAL_S, self._report)
