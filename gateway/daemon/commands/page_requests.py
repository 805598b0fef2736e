"""What people do on the page: their requests with the answers, and the wrong PINs that they enter."""

import queue
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from gateway.authorization.caller import Caller, NotAuthorised, Role, require_role
from gateway.daemon.commands.requests import RemoteRequest, RequestHandler
from gateway.daemon.commands.security import Refusal, SecurityLog
from gateway.daemon.runtime.worker import FaultRegister
from gateway.page.sign_in import SignInReport
from gateway.recalibration.requests import RequestError, parse_payload
from gateway.verbs import VERBS

PATIENCE_S = 4.0
"""Longest wait for an answer. Basis: a choice; below the 6 s for which the page waits (`gateway.page.gateway_requests`)."""
PIN_GUESSED = "pin_guessed"


class PageRequest(BaseModel):
    """A request as the page sends it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    """Number that the answer repeats."""
    verb: str
    payload: str


class PageRequests:
    """Passes requests of the page on to the same handlers as those of the bus. The page has checked the person's PIN."""

    def __init__(self, handlers: Mapping[str, RequestHandler]) -> None:
        self._handlers = handlers

    def answer(self, packet: bytes) -> bytes:
        """Carry out a request and return the answer as JSON. Called by the thread of the page's channel."""
        try:
            request = PageRequest.model_validate_json(packet)
        except ValidationError:
            return to_json({"number": None, "accepted": False, "text": "no request of the page"})
        accepted, text = self._carry_out(request)
        return to_json({"number": request.number, "accepted": accepted, "text": text})

    def _carry_out(self, request: PageRequest) -> tuple[bool, str]:
        handler = self._handlers.get(request.verb)
        if handler is None:
            return False, f"{request.verb} is not available"
        answers: queue.SimpleQueue[tuple[bool, str]] = queue.SimpleQueue()
        try:
            handler(_admit(request, answers))
            return answers.get(timeout=PATIENCE_S)
        except (NotAuthorised, RequestError) as refusal:
            return False, str(refusal)
        except queue.Empty:
            return False, f"no answer in {PATIENCE_S:.0f} s; it may have been done"


def _admit(request: PageRequest, answers: "queue.SimpleQueue[tuple[bool, str]]") -> RemoteRequest:
    """Return the request of an operator for its handler. Raises `NotAuthorised` or `RequestError`."""
    verb, caller = VERBS[request.verb], Caller(None, Role.OPERATOR, "page_pin")
    if verb.role is not None:
        require_role(caller, verb.role)

    def reply(accepted: bool, content: Mapping[str, Any]) -> None:
        answers.put((accepted, str(content.get("text" if accepted else "reason", ""))))

    return RemoteRequest(verb.name, parse_payload(verb.request, request.payload.encode()), caller, reply)


class SignInWatch:
    """Takes the reports of the page; used by the thread of the remote calls alone."""

    def __init__(
        self, security_log: SecurityLog, faults: FaultRegister, pin_file: Path, now_ns: Callable[[], int]
    ) -> None:
        self._security_log = security_log
        self._faults = faults
        self._pin_file = pin_file
        self._now_ns = now_ns

    def take(self, payload: bytes) -> None:
        """Count what a report says. The fault stands until somebody signs in with the new PIN."""
        try:
            report = SignInReport.model_validate_json(payload)
        except ValidationError:
            return
        if report.wrong:
            refusal = Refusal("page/sign-in", "wrong_pin", None, "a PIN was entered that is not that of this gateway")
            self._security_log.add(refusal, lambda: report.address, self._now_ns(), report.wrong)
        match report.pin:
            case "replaced":
                text = f"the PIN of the page is void after too many wrong ones: somebody guesses; {self._pin_file} has a new one"
                self._faults.set(PIN_GUESSED, text)
            case "void":
                text = f"{self._pin_file}: the PIN is void after too many wrong ones, and no new one can be written"
                self._faults.set(PIN_GUESSED, text)
            case "good":
                self._faults.clear(PIN_GUESSED)
