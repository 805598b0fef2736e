"""The credential of a request: what travels in the attachment of its Zenoh query.

The gateway issues a challenge (`rpc/challenge`): its boot id and its own time. The caller proves a statement about the request
and that challenge, so that a credential is worth nothing for another request, gateway or boot, or later. The token is a secret
that only the service's group can read, on a gateway that listens on loopback alone; the other scheme are certificates.
"""

import hashlib
import hmac
import json
from dataclasses import astuple, dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from gateway.authorization.caller import Caller, NotAuthorised, Role

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
