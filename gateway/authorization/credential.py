"""The credential of a request: what travels in the attachment of its Zenoh query, and the authoriser that checks it.

The gateway issues a challenge (`rpc/challenge`): its boot id and its own time. The caller proves a statement about the request
and that challenge, so that a credential is worth nothing for another request, gateway or boot, or later. The token is a secret
that only the service's group can read, on a gateway that listens on loopback alone; the other scheme are certificates.

A credential is good once, for a short time after its challenge. The time of a challenge is authentic: its last bits are a code of
the others by a secret of this boot. Who passes messages on can therefore not invent the challenge of a later time, have it
signed, and keep the request until then; and nothing has to be remembered of the challenges that were given out.
"""

import hashlib
import hmac
import json
import secrets
from collections import OrderedDict
from dataclasses import astuple, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from gateway.authorization.caller import Caller, NotAuthorised, Role, require_role

if TYPE_CHECKING:
    from gateway.authorization.certificates import CertificateVerifier  # its library is an extra

MAX_CREDENTIAL_BYTES = 8192
"""Largest credential. Basis: a choice; a certificate and a signature have a few kilobytes, and a flood stays cheap."""
BootId = Annotated[str, Field(pattern=r"^[0-9a-f]{12}$")]
VOUCHER_FIELD = "voucher"
"""Field of the answer to `rpc/challenge` with the `Voucher` for the gateway's key; it is there where the site has a CA."""
KeyId = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
TimeNs = Annotated[int, Field(ge=0, lt=2**63)]
TOKEN_NAME = "command-token"
TOKEN_BYTES = 32
"""Basis: 256 random bits cannot be guessed."""
WINDOW_S = 30.0
"""Time after a challenge within which its credential must arrive. Basis: a link across a site needs a fraction of it."""
MAX_REMEMBERED = 1024
"""Credentials that are remembered; of older ones none is accepted, so that a flood cannot push one out and repeat it. Basis: a
choice; more than honest callers send in `WINDOW_S`, and a bound of the memory."""
CODE_BITS = 24
"""Bits of the code. Basis: a choice; a guess is right once in 17 million times, a caller signs one challenge for each request,
and 2^24 ns, 17 ms, is the step of the time that is left."""


class Challenge(BaseModel):
    """The answer to `rpc/challenge`."""

    model_config = ConfigDict(frozen=True)

    boot_id: BootId
    time_ns: TimeNs
    """The gateway's own time, which never steps within a boot; its last bits are a code by which the gateway knows it again."""
    scheme: Literal["token", "certificate"]
    token_id: KeyId | None = None
    """Id of the token that the gateway accepts; null where certificates are required."""


class TokenCredential(BaseModel):
    """Proof by the secret token of a gateway's service."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scheme: Literal["token"] = "token"
    boot_id: BootId
    time_ns: TimeNs
    token_id: KeyId
    mac: str = Field(pattern=r"^[0-9a-f]{64}$")
    """HMAC-SHA256 (RFC 2104) of the statement, in hexadecimal digits."""


class CertificateCredential(BaseModel):
    """Proof by the private key of an X.509 certificate that the site's CA has issued."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scheme: Literal["certificate"] = "certificate"
    boot_id: BootId
    time_ns: TimeNs
    certificate: str = Field(max_length=4096)
    """The certificate in PEM."""
    signature: str = Field(pattern=r"^([0-9a-f]{2}){1,256}$")
    """Ed25519 (RFC 8032) or ECDSA with SHA-256 (FIPS 186-5) signature of the statement, in hexadecimal digits."""


Credential = TokenCredential | CertificateCredential
_ADAPTER: TypeAdapter[Credential] = TypeAdapter(Annotated[Credential, Field(discriminator="scheme")])


@dataclass(frozen=True, slots=True)
class RequestStatement:
    """What a credential proves: this request, to this gateway, in this boot, at this time of the gateway."""

    key_expr: str
    payload_sha256: str
    boot_id: str
    time_ns: int

    def encode(self) -> bytes:
        """Return the bytes that are authenticated; no two statements have the same."""
        return json.dumps(["plumbline-request-1", *astuple(self)]).encode()


def make_statement(key_expr: str, payload: bytes, challenge: "Challenge | Credential") -> RequestStatement:
    """Return the statement of a request in answer to a challenge."""
    return RequestStatement(key_expr, hashlib.sha256(payload).hexdigest(), challenge.boot_id, challenge.time_ns)


def parse_credential(attachment: bytes | None) -> Credential:
    """Return the credential in an attachment. Raises `NotAuthorised`."""
    if attachment is None:
        raise NotAuthorised(
            "no_credential",
            "no credential; call plumbline remote where it may read the gateway's command-token, "
            "or name a folder with certificates by --credentials",
        )
    if len(attachment) > MAX_CREDENTIAL_BYTES:
        raise NotAuthorised("malformed_credential", f"the credential has more than {MAX_CREDENTIAL_BYTES} bytes")
    try:
        return _ADAPTER.validate_json(attachment)
    except ValidationError as error:
        raise NotAuthorised(
            "malformed_credential", "the credential is not in the form that docs/reference/requests.md describes"
        ) from error


def parse_token(text: str) -> bytes | None:
    """Return the secret in the content of a token file; None where it is not one."""
    try:
        secret = bytes.fromhex(text.strip())
    except ValueError:
        return None
    return secret if len(secret) == TOKEN_BYTES else None


def token_id(secret: bytes) -> str:
    """Return the public id of a token, from which the secret cannot be computed."""
    return hashlib.sha256(b"plumbline-token-id" + secret).hexdigest()[:16]


def prove_by_token(secret: bytes, key_expr: str, payload: bytes, challenge: Challenge) -> TokenCredential:
    """Return the credential of a request."""
    mac = _mac(secret, make_statement(key_expr, payload, challenge))
    return TokenCredential(boot_id=challenge.boot_id, time_ns=challenge.time_ns, token_id=token_id(secret), mac=mac)


def authenticate_token(secret: bytes, credential: TokenCredential, statement: RequestStatement) -> Caller:
    """Return the caller, who may do everything; the request states the name. Raises `NotAuthorised`."""
    if not hmac.compare_digest(credential.mac, _mac(secret, statement)):
        raise NotAuthorised(
            "wrong_token",
            "the token is not that of this gateway, or the request was altered; "
            "name the folder of the gateway's command-token by --credentials",
        )
    return Caller(None, Role.SERVICE, "token")


def _mac(secret: bytes, statement: RequestStatement) -> str:
    return hmac.new(secret, statement.encode(), hashlib.sha256).hexdigest()


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
