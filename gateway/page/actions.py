"""What a person can do on the page: sign in with name and PIN, acknowledge alarms, sign out."""

import logging
import secrets
import time
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import to_json
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from gateway.page.gateway_requests import GatewayRequests
from gateway.page.guard import BodyError, read_body
from gateway.page.pin import read_pin
from gateway.page.sign_in import EXPIRY_S, SignedInPerson, SignIn
from gateway.page.state import PageState

log = logging.getLogger("page")
Name = Annotated[
    str, Field(min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f\u2028\u2029]*\S[^\x00-\x1f\x7f\u2028\u2029]*$")
]
Content = TypeVar("Content", bound=BaseModel)


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

    def _pin(self) -> str | None:
        return read_pin(self._state.parameters.pin_file)

    def _session(self, request: Request) -> SignedInPerson | None:
        return self._sign_in.session(request.cookies.get(self._cookie), self._pin(), time.monotonic())

    async def _get_session(self, request: Request) -> Response:
        session = self._session(request)
        return _answer(200, name=None if session is None else session.name, available=self._pin() is not None)

    async def _post_sign_in(self, request: Request) -> Response:
        content = await _read(request, SignInContent)
        if isinstance(content, Response):
            return content
        pin, now_s = self._pin(), time.monotonic()
        address = request.client.host if request.client else ""
        if pin is None:
            return _answer(503, error="no_pin")
        if (pause_s := self._sign_in.pause_s(address, now_s)) > 0:
            return _answer(429, error="pin_pause", seconds=int(pause_s) + 1)
        token = self._sign_in.sign_in(content.name.strip(), content.pin.strip(), pin, address, now_s)
        if token is None:
            log.warning("a wrong PIN was entered at %s", address)
            return _answer(403, error="pin_wrong")
        response = _answer(200, name=content.name.strip())
        response.set_cookie(self._cookie, token, max_age=int(EXPIRY_S), httponly=True, samesite="strict")
        return response

    async def _post_sign_out(self, request: Request) -> Response:
        self._sign_in.sign_out(request.cookies.get(self._cookie))
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
    return Response(to_json(content), status, media_type="application/json")
