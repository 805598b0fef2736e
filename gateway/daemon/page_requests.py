"""The requests that people make on the page, and their answers."""

import queue
from collections.abc import Callable, Mapping

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from gateway.daemon.recalibration_service import PendingRequest
from gateway.recalibration.journal import RequestAnswer

Submit = Callable[[PendingRequest], bool]
"""Passes a request on to the thread that answers it; False: too many are waiting."""
PATIENCE_S = 4.0
"""Longest wait for an answer; the page waits longer."""


class PageRequest(BaseModel):
    """A request as the page sends it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    """Number that the answer repeats."""
    verb: str
    payload: str


class PageRequests:
    """Passes requests of the page on to the same services as those of the bus."""

    def __init__(self, services: Mapping[str, Submit]) -> None:
        self._services = services

    def answer(self, packet: bytes) -> bytes:
        """Carry out a request and return the answer as JSON. Called by the thread of the page's channel."""
        try:
            request = PageRequest.model_validate_json(packet)
        except ValidationError:
            return to_json({"number": None, "accepted": False, "text": "no request of the page"})
        accepted, text = self._carry_out(request)
        return to_json({"number": request.number, "accepted": accepted, "text": text})

    def _carry_out(self, request: PageRequest) -> tuple[bool, str]:
        submit = self._services.get(request.verb)
        if submit is None:
            return False, f"{request.verb} is not available"
        answers: queue.SimpleQueue[RequestAnswer] = queue.SimpleQueue()
        if not submit(PendingRequest(request.verb, request.payload.encode(), answers.put)):
            return False, "busy: too many requests are waiting"
        try:
            answer = answers.get(timeout=PATIENCE_S)
        except queue.Empty:
            return False, f"no answer in {PATIENCE_S:.0f} s; it may have been done"
        return answer.accepted, answer.text
