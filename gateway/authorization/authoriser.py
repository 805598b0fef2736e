"""The authoriser: who sends a request, whether that role may send it, and whether the credential is fresh."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gateway.authorization.caller import Caller, NotAuthorised, Role, require_role
from gateway.authorization.credential import (
    CertificateCredential,
    Challenge,
    Credential,
    RequestStatement,
    TokenCredential,
    make_statement,
    parse_credential,
)
from gateway.authorization.freshness import Freshness
from gateway.authorization.token import authenticate_token, token_id

if TYPE_CHECKING:
    from gateway.authorization.certificates import CertificateVerifier  # its library is an extra


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
