"""Requests of the page to its gateway over the channel, their answers, and reports."""

import asyncio
import itertools
import socket
import time
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError
from pydantic_core import to_json

from gateway.page.channel import REPORT, REQUEST, Frame, encode_frame

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
