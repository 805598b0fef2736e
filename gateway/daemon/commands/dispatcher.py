"""Requests from the bus: limited, authorised, validated, and passed on to the handler of their verb."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from pydantic import BaseModel

from gateway.authorization.authoriser import Authoriser, SignedRequest
from gateway.authorization.caller import Caller, NotAuthorised
from gateway.authorization.token_bucket import CallerLimits, RateLimit, TokenBucket
from gateway.daemon.commands.requests import RemoteRequest, Reply, RequestHandler
from gateway.daemon.commands.security_log import Refusal, SecurityLog
from gateway.recalibration.requests import Request, RequestError, parse_payload
from gateway.verbs import VERBS, Verb

ANSWERED_REFUSALS = RateLimit(burst=50, per_s=20.0)
"""Refusals that are answered; a flood beyond it is dropped without an answer, and counted. Basis: a choice; more than honest
callers cause, and cheap beside the 1000 challenges per second."""


class RequestDispatcher:
    """Used by the thread of the remote calls alone."""

    def __init__(
        self,
        key: str,
        authoriser: Authoriser,
        handlers: Mapping[str, RequestHandler],
        security_log: SecurityLog,
        now_ns: Callable[[], int],
    ) -> None:
        """`key` is that of the gateway; `now_ns` is gateway time."""
        self._key = key
        self._authoriser = authoriser
        self._handlers = dict(handlers)
        self._security_log = security_log
        self._now_ns = now_ns
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
            reply(True, self._authoriser.challenge(self._now_ns()).model_dump(mode="json"))
        else:
            self._handlers[verb.name](RemoteRequest(verb.name, content, caller, reply))

    def _refuse(self, verb: Verb, refusal: NotAuthorised, origin: Callable[[], str], reply: Reply) -> None:
        if self._refusals.take(self._now_ns()):
            reply(False, {"id": "", "accepted": False, "reason": str(refusal), "kind": refusal.kind})
        self._security_log.add(
            Refusal(f"rpc/{verb.name}", refusal.kind, refusal.name, str(refusal)), origin, self._now_ns()
        )
