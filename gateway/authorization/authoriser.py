"""The authoriser: who sends a request, whether that role may send it, and whether its credential is fresh.

A credential is good once, for a short time after its challenge, in one boot of one gateway. The time of a challenge is
authentic: its last bits are a code of the others by a secret of this boot. Who passes messages on can therefore not invent the
challenge of a later time, have it signed, and keep the request until then; and nothing has to be remembered of the challenges
that were given out.
"""

import hashlib
import hmac
import secrets
from collections import OrderedDict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gateway.authorization.caller import Caller, NotAuthorised, Role, require_role
from gateway.authorization.credential import (
    CertificateCredential,
    Challenge,
    Credential,
    RequestStatement,
    TokenCredential,
    authenticate_token,
    make_statement,
    parse_credential,
    token_id,
)

if TYPE_CHECKING:
    from gateway.authorization.certificates import CertificateVerifier  # its library is an extra


WINDOW_S = 30.0
"""Time after a challenge within which its credential must arrive. Basis: a link across a site needs a fraction of it."""
MAX_REMEMBERED = 1024
"""Credentials that are remembered; of older ones none is accepted, so that a flood cannot push one out and repeat it. Basis: a
choice; more than honest callers send in `WINDOW_S`, and a bound of the memory."""
CODE_BITS = 24
"""Bits of the code. Basis: a choice; a guess is right once in 17 million times, a caller signs one challenge for each request,
and 2^24 ns, 17 ms, is the step of the time that is left."""


class Freshness:
    """Remembers the statements that were proven. Times are those of the gateway, which never step."""

    def __init__(self, boot_id: str) -> None:
        self._boot_id = boot_id
        self._secret = secrets.token_bytes(32)
        self._used: OrderedDict[RequestStatement, None] = OrderedDict()
        self._oldest_ns = -1
        """A credential must be newer than every one that was forgotten."""

    def issue(self, now_ns: int) -> int:
        """Return the time of a challenge: at most two steps of `CODE_BITS` before now, with its code."""
        return self._with_code(max((now_ns >> CODE_BITS) - 1, 0))

    def _with_code(self, step: int) -> int:
        code = hmac.digest(self._secret, step.to_bytes(8, "big"), hashlib.sha256)
        return (step << CODE_BITS) | (int.from_bytes(code[:8], "big") >> (64 - CODE_BITS))

    def check(self, boot_id: str, time_ns: int, now_ns: int) -> None:
        """Refuse a credential of another boot, an expired or invented one, or one from the future. Raises `NotAuthorised`."""
        if boot_id != self._boot_id:
            raise NotAuthorised("stale_credential", "the credential is that of another boot of the gateway; repeat")
        if not 0 <= now_ns - time_ns <= WINDOW_S * 1e9 or time_ns <= self._oldest_ns:
            raise NotAuthorised("stale_credential", "the credential is too old; repeat the request")
        if time_ns != self._with_code(time_ns >> CODE_BITS):
            raise NotAuthorised(
                "stale_credential", "the credential answers a challenge that this gateway has not given"
            )

    def use(self, statement: RequestStatement) -> None:
        """Use up what an authentic credential has proven. Raises `NotAuthorised` where it was used before."""
        if statement in self._used:
            raise NotAuthorised(
                "replayed_credential", "the credential was used before; repeat the request with a new one"
            )
        self._used[statement] = None
        while len(self._used) > MAX_REMEMBERED:
            forgotten, _ = self._used.popitem(last=False)
            self._oldest_ns = max(self._oldest_ns, forgotten.time_ns)


@dataclass(frozen=True, slots=True)
class SignedRequest:
    """A request as it has arrived."""

    key_expr: str
    payload: bytes
    attachment: bytes | None


class Authoriser:
    """Authenticates the requests of one boot. Times are those of the gateway, which never step."""

    def __init__(self, boot_id: str, proof: "bytes | CertificateVerifier") -> None:
        """`proof` is the secret of the service's group, or checks certificates where the site has a CA."""
        self._boot_id = boot_id
        self._proof = proof
        self._freshness = Freshness(boot_id)

    def challenge(self, now_ns: int) -> Challenge:
        """Return the challenge for the next request of a caller."""
        time_ns = self._freshness.issue(now_ns)
        if isinstance(self._proof, bytes):
            return Challenge(boot_id=self._boot_id, time_ns=time_ns, scheme="token", token_id=token_id(self._proof))
        return Challenge(boot_id=self._boot_id, time_ns=time_ns, scheme="certificate")

    def admit(self, request: SignedRequest, role: Role, now_ns: int) -> Caller:
        """Return the authenticated caller of a request that requires a role. Raises `NotAuthorised`."""
        credential = parse_credential(request.attachment)
        self._freshness.check(credential.boot_id, credential.time_ns, now_ns)
        statement = make_statement(request.key_expr, request.payload, credential)
        caller = self._authenticate(credential, statement)
        self._freshness.use(statement)
        require_role(caller, role)
        return replace(caller, asked_ns=credential.time_ns)

    def _authenticate(self, credential: Credential, statement: RequestStatement) -> Caller:
        if isinstance(self._proof, bytes):
            if not isinstance(credential, TokenCredential):
                raise NotAuthorised(
                    "wrong_scheme", "this gateway has no bus.tls.ca; it accepts its command-token alone"
                )
            return authenticate_token(self._proof, credential, statement)
        if not isinstance(credential, CertificateCredential):
            raise NotAuthorised("wrong_scheme", "this gateway accepts certificates of its bus.tls.ca alone")
        return self._proof.authenticate(credential, statement)
