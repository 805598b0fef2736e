"""What certificates of the site's CA prove: the caller of a request, and the key with which a gateway signs.

A caller signs each request with the key of a certificate that the CA has issued and not revoked. A gateway signs a voucher with
the key of its own: what it says of the key that signs what the gateway sends and records. So the CA vouches for the signing key
at one remove: for the holder of the certificate, who vouches for the key.
"""

import json
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.authorization.caller import Caller, NotAuthorised, Role
from gateway.authorization.credential import CertificateCredential, Challenge, RequestStatement, make_statement
from gateway.pki.inspect import (
    CertificateError,
    check_issued,
    identity_of,
    is_signed,
    parse_authorities,
    parse_certificate,
    revoked_serials,
)
from gateway.pki.site_folder import Holder

ROLES = {"operator": Role.OPERATOR, "service": Role.SERVICE}
PrivateKey = ed25519.Ed25519PrivateKey | ec.EllipticCurvePrivateKey
REMEMBERED = 64
"""Certificates that are remembered. Basis: a choice; more than a site has callers, and a bound of the memory."""


class CertificateVerifier:
    """Authenticates callers by their certificates."""

    def __init__(
        self,
        authorities: Sequence[x509.Certificate],
        revoked: Callable[[], frozenset[int]],
        utc_now: Callable[[], datetime],
    ) -> None:
        """`revoked` returns the serial numbers of the present revocation list, or raises `CertificateError`."""
        self._authorities = tuple(authorities)
        self._revoked = revoked
        self._utc_now = utc_now
        self._parse = lru_cache(maxsize=REMEMBERED)(parse_certificate)

    def authenticate(self, credential: CertificateCredential, statement: RequestStatement) -> Caller:
        """Return the caller. Raises `NotAuthorised`."""
        name = None
        try:
            certificate = self._parse(credential.certificate.encode())
            identity = identity_of(certificate)
            check_issued(certificate, self._authorities, self._utc_now())
            name = identity.name
        except CertificateError as error:
            raise NotAuthorised("wrong_certificate", f"the certificate {error}", name) from error
        try:
            revoked = self._revoked()
        except CertificateError as error:
            raise NotAuthorised("revocation_unknown", f"bus.tls.revoked {error}; correct it", name) from error
        if identity.serial in revoked:
            raise NotAuthorised("revoked_certificate", "the certificate was revoked", name)
        if not is_signed(certificate, statement.encode(), bytes.fromhex(credential.signature)):
            raise NotAuthorised(
                "wrong_signature", "the signature is not that of the certificate, or of another request", name
            )
        if identity.holder not in ROLES:
            raise NotAuthorised(
                "wrong_role", f"the certificate is that of a {identity.holder or 'holder without a role'}", name
            )
        return Caller(name, ROLES[identity.holder], "certificate")


def load_key(pem: bytes) -> PrivateKey:
    """Return the private key in a PEM text. Raises `ValueError` where it is none that signs requests."""
    key = serialization.load_pem_private_key(pem, password=None)
    if not isinstance(key, PrivateKey):
        raise ValueError("the key is neither an elliptic curve key nor an Ed25519 key")  # noqa: TRY004 (the file is wrong)
    return key


def prove_by_certificate(
    certificate_pem: str, key: PrivateKey, key_expr: str, payload: bytes, challenge: Challenge
) -> CertificateCredential:
    """Return the credential of a request."""
    signature = sign(key, make_statement(key_expr, payload, challenge).encode())
    return CertificateCredential(
        boot_id=challenge.boot_id, time_ns=challenge.time_ns, certificate=certificate_pem, signature=signature.hex()
    )


def sign(key: PrivateKey, content: bytes) -> bytes:
    """Return the signature of a content with the key of a certificate."""
    if isinstance(key, ed25519.Ed25519PrivateKey):
        return key.sign(content)
    return key.sign(content, ec.ECDSA(hashes.SHA256()))


class Voucher(BaseModel):
    """What travels in the answer to `rpc/challenge`, and in each segment of a recording."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    certificate: str = Field(max_length=4096)
    """The gateway's certificate in PEM."""
    signature: str = Field(pattern=r"^([0-9a-f]{2}){1,256}$")
    """Signature of the certificate's key for the statement, in hexadecimal digits."""


def make_voucher(certificate_pem: bytes, key_pem: bytes, gateway: str, public_key: str) -> Voucher:
    """Return the voucher of a gateway for its signing key. Raises `ValueError` for files that cannot be used."""
    signature = sign(load_key(key_pem), _statement(gateway, public_key))
    return Voucher(certificate=certificate_pem.decode("ascii"), signature=signature.hex())


def parse_voucher(content: object) -> Voucher:
    """Return a voucher from its JSON value. Raises `CertificateError`."""
    try:
        return Voucher.model_validate(content)
    except ValidationError as error:
        raise CertificateError("has a voucher that cannot be read") from error


def check_voucher(
    voucher: Voucher,
    gateway: str,
    public_key: str,
    authorities: Sequence[x509.Certificate],
    revoked: frozenset[int],
    now: datetime,
) -> None:
    """Refuse a voucher that does not say now that this key is that of this gateway. Raises `CertificateError`."""
    certificate = parse_certificate(voucher.certificate.encode())
    check_issued(certificate, authorities, now)
    identity = identity_of(certificate)
    if identity.serial in revoked:
        raise CertificateError("was revoked")
    if identity.holder != Holder.GATEWAY:
        raise CertificateError(f"is not that of a gateway, but that of {identity.holder or 'nobody'} {identity.name}")
    if identity.name not in (names := certificate_names(gateway)):
        raise CertificateError(f"is that of {identity.name}, not of {' or '.join(names)}")
    if not is_signed(certificate, _statement(gateway, public_key), bytes.fromhex(voucher.signature)):
        raise CertificateError("does not vouch for this key of this gateway")


def certificate_names(gateway: str) -> tuple[str, str]:
    """Return the common names of a certificate that speaks for a gateway: its crane, or one sensor of it."""
    *_, crane, sensor = ("", "", *gateway.split("/"))
    return crane, f"{crane}.{sensor}"


def _statement(gateway: str, public_key: str) -> bytes:
    """Return the bytes that are signed; no request, message or answer has the same."""
    return json.dumps(["plumbline-voucher-1", gateway, public_key]).encode()


class SiteAuthority:
    """Reads its files anew for each question: a revocation list may have come, and first contacts are few."""

    def __init__(self, ca: Path, revoked: Path | None = None) -> None:
        """`revoked` is the revocation list; where there is no such file, nothing is revoked."""
        self._ca = ca
        self._revoked = revoked

    def refuse(self, gateway: str, public_key: str, voucher: object) -> str | None:
        """Return why a voucher does not say that this key is that of this gateway; None: it does."""
        try:
            authorities = parse_authorities(self._ca.read_bytes())
            revoked: frozenset[int] = frozenset()
            if self._revoked is not None and self._revoked.exists():
                revoked = revoked_serials(self._revoked.read_bytes(), authorities)
        except OSError as error:
            return f"{error.filename}: cannot be read ({error.strerror})"
        except CertificateError as error:
            return f"{self._ca.parent}: ca.pem or revoked.pem {error}"
        try:
            check_voucher(parse_voucher(voucher), gateway, public_key, authorities, revoked, datetime.now(UTC))
        except CertificateError as error:
            return f"its certificate {error}"
        return None
