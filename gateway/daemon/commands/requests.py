"""Requests: from the bus, limited, authorised, validated, and passed on to the handler of their verb; each is answered once.

Those that another thread carries out wait in a queue on their way to it.
"""

import json
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from pydantic import BaseModel

from gateway.authorization.authoriser import Authoriser, SignedRequest
from gateway.authorization.caller import Caller, CallerLimits, NotAuthorised, RateLimit, TokenBucket
from gateway.authorization.credential import VOUCHER_FIELD
from gateway.daemon.commands.security import Refusal, SecurityLog
from gateway.recalibration.requests import Request, RequestAnswer, RequestError, parse_payload
from gateway.verbs import VERBS, Verb

Model = TypeVar("Model", bound=BaseModel)
Reply = Callable[[bool, Mapping[str, Any]], object]
"""Sends an answer: whether the request was accepted, and the content. It may be called by any thread, once."""
BUSY = "busy: too many requests are waiting"
HANGS = "the disk does not answer"
ANSWERED_REFUSALS = RateLimit(burst=50, per_s=20.0)
"""Refusals that are answered; a flood beyond it is dropped without an answer, and counted. Basis: a choice; more than honest
callers cause, and cheap beside the 1000 challenges per second."""


def _begin_at_once() -> None:
    """Begin a request that nobody else may refuse."""


@dataclass(frozen=True, slots=True)
class RemoteRequest:
    """A request of the verb's model; `by` in it is the authenticated name."""

    verb: str
    content: BaseModel
    caller: Caller | None
    """None for a verb that needs no role."""
    reply: Reply
    begin: Callable[[], None] = _begin_at_once
    """Called before anything is changed; raises `TimeoutError` where the request was refused meanwhile."""

    def expect(self, model: type[Model]) -> Model:
        """Return the content. Raises `TypeError` where the table of verbs names another model than the handler."""
        if not isinstance(self.content, model):
            raise TypeError(f"rpc/{self.verb}: a {type(self.content).__name__} is no {model.__name__}")
        return self.content

    def refuse(self, why: str) -> None:
        """Send a refusal."""
        self.reply(False, {"id": getattr(self.content, "id", ""), "accepted": False, "reason": why})

    def answer(self, answer: RequestAnswer) -> None:
        """Send the answer."""
        self.reply(answer.accepted, answer.payload())


RequestHandler = Callable[[RemoteRequest], None]
"""Answers the requests of one verb, now or later."""


class RequestQueue:
    """At most `size` requests, and the present one. What `refuse` has answered before it was begun is not carried out."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._lock = threading.Lock()
        self._waiting: deque[RemoteRequest] = deque()
        self._present: RemoteRequest | None = None
        self._is_begun = False
        self.dropped = 0
        """Number of requests that came while too many were waiting."""

    def submit(self, request: RemoteRequest) -> None:
        """Add a request, or refuse it if too many are waiting. Called by any thread."""
        with self._lock:
            has_room = len(self._waiting) < self._size
            if has_room:
                self._waiting.append(request)
            else:
                self.dropped += 1
        if not has_room:
            request.refuse(BUSY)

    def take(self) -> RemoteRequest | None:
        """Return the oldest request, which is the present one until the next call; None: none is waiting."""
        with self._lock:
            self._present, self._is_begun = self._waiting.popleft() if self._waiting else None, False
            request = self._present
        if request is None:
            return None
        return replace(request, begin=partial(self._begin, request), reply=partial(self._reply, request))

    def refuse(self, why: str) -> None:
        """Refuse what was not begun. A copy of the request that was begun waits for its answer. Called by any thread."""
        with self._lock:
            refused = list(self._waiting)
            if self._present is not None and self._is_begun:
                begun = _id_of(self._present)
                refused = [each for each in refused if _id_of(each) != begun]
                self._waiting = deque(each for each in self._waiting if _id_of(each) == begun)
            else:
                self._waiting.clear()
                if self._present is not None:
                    refused.insert(0, self._present)
                    self._present = None
        for each in refused:
            each.refuse(why)

    def _begin(self, request: RemoteRequest) -> None:
        with self._lock:
            if self._present is not request:
                raise TimeoutError(HANGS)
            self._is_begun = True

    def _reply(self, request: RemoteRequest, accepted: bool, content: Mapping[str, Any]) -> None:
        with suppress(TimeoutError):
            self._begin(request)
            request.reply(accepted, content)


def _id_of(request: RemoteRequest) -> str:
    return str(getattr(request.content, "id", ""))


class RequestDispatcher:
    """Used by the thread of the remote calls alone."""

    def __init__(
        self,
        key: str,
        authoriser: Authoriser,
        handlers: Mapping[str, RequestHandler],
        security_log: SecurityLog,
        now_ns: Callable[[], int],
        voucher: Callable[[], str | None] = lambda: None,
    ) -> None:
        """`key` is that of the gateway; `now_ns` is gateway time; `voucher` returns what vouches for its signing key in JSON."""
        self._key = key
        self._authoriser = authoriser
        self._handlers = dict(handlers)
        self._security_log = security_log
        self._now_ns = now_ns
        self._voucher = voucher
        self._reads = {verb.name: TokenBucket(verb.limit) for verb in VERBS.values() if verb.role is None}
        self._changes = {verb.name: CallerLimits(verb.limit) for verb in VERBS.values() if verb.role is not None}
        self._refusals = TokenBucket(ANSWERED_REFUSALS)

    def use(self, authoriser: Authoriser) -> None:
        """Authorise by another authoriser from now on."""
        self._authoriser = authoriser

    @property
    def verbs(self) -> tuple[str, ...]:
        """The verbs that are served."""
        return tuple(name for name in VERBS if name in self._handlers or name == "challenge")

    def receive(self, name: str, request: SignedRequest, origin: Callable[[], str], reply: Reply) -> None:
        """Handle a request from the bus; `origin` describes where it may have come from."""
        verb, caller = VERBS[name], None
        try:
            self._check_form(verb, request)
            if verb.role is None:
                self._limit_read(verb)
            else:
                caller = self._authoriser.admit(request, verb.role, self._now_ns())
                self._limit_change(verb, caller)
            self._pass_on(verb, request.payload, caller, reply)
        except NotAuthorised as refusal:
            self._refuse(verb, refusal, origin, reply)

    def refuse_signal(self, key: str, kind: str, why: str, origin: Callable[[], str]) -> None:
        """Note what was not taken on a key of the gateway; nobody waits for an answer to it."""
        self._security_log.add(Refusal(key, kind, None, why), origin, self._now_ns())

    def _check_form(self, verb: Verb, request: SignedRequest) -> None:
        if len(request.payload) > verb.max_bytes:
            text = f"a request of {len(request.payload)} bytes; {verb.max_bytes} is the most"
            raise NotAuthorised("too_large", text)
        if verb.role is not None and request.key_expr != f"{self._key}/rpc/{verb.name}":
            text = f"{request.key_expr} may mean several gateways; ask one: {self._key}"
            raise NotAuthorised("ambiguous_key", text)

    def _limit_read(self, verb: Verb) -> None:
        if not self._reads[verb.name].take(self._now_ns()):
            raise NotAuthorised("rate_limited", f"more than {verb.limit.per_s:g} {verb.name} requests per second")

    def _limit_change(self, verb: Verb, caller: Caller) -> None:
        if not self._changes[verb.name].take(caller.name or caller.scheme, self._now_ns()):
            raise NotAuthorised(
                "rate_limited", f"more than {verb.limit.per_s:g} {verb.name} requests per second", caller.name
            )

    def _pass_on(self, verb: Verb, payload: bytes, caller: Caller | None, reply: Reply) -> None:
        try:
            content: BaseModel = parse_payload(verb.request, payload)
        except RequestError as error:
            raise NotAuthorised("invalid_request", str(error), None if caller is None else caller.name) from error
        if caller is not None and isinstance(content, Request):
            if caller.name is None:
                caller = replace(caller, name=content.by)
            content = content.model_copy(update={"by": caller.name})
        if verb.name == "challenge":
            reply(True, self._challenge())
        else:
            self._handlers[verb.name](RemoteRequest(verb.name, content, caller, reply))

    def _challenge(self) -> dict[str, Any]:
        voucher, challenge = self._voucher(), self._authoriser.challenge(self._now_ns()).model_dump(mode="json")
        return challenge if voucher is None else {**challenge, VOUCHER_FIELD: json.loads(voucher)}

    def _refuse(self, verb: Verb, refusal: NotAuthorised, origin: Callable[[], str], reply: Reply) -> None:
        if self._refusals.take(self._now_ns()):
            reply(False, {"id": "", "accepted": False, "reason": str(refusal), "kind": refusal.kind})
        self._security_log.add(
            Refusal(f"rpc/{verb.name}", refusal.kind, refusal.name, str(refusal)), origin, self._now_ns()
        )
