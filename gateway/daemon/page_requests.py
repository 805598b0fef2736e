"""The requests that people make on the page, and their answers."""

from collections.abc import Callable, Mapping

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from gateway.recalibration.journal import RequestAnswer

Handler = Callable[[bytes], RequestAnswer]
"""Carries out a request from its JSON payload, and waits until that is done."""


class PageRequest(BaseModel):
    """A request as the page sends it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    """Number that the answer repeats."""
    verb: str
    payload: str


class PageRequests:
    """Passes requests of the page on to the same handlers as those of the bus."""

    def __init__(self, handlers: Mapping[str, Handler]) -> None:
        self._handlers = handlers

    def answer(self, packet: bytes) -> bytes:
        """Carry out a request and return the answer as JSON. Called by the thread of the page's channel."""
        try:
            request = PageRequest.model_validate_json(packet)
        except ValidationError:
            return to_json({"number": None, "accepted": False, "text": "no request of the page"})
        handler = self._handlers.get(request.verb)
        if handler is None:
            return to_json({"number": request.number, "accepted": False, "text": f"{request.verb} is not available"})
        answer = handler(request.payload.encode())
        return to_json({"number": request.number, "accepted": answer.accepted, "text": answer.text})
