"""The certificate scheme: a signature with the key of a certificate that the site's CA has issued and not revoked."""

from collections.abc import Callable, Sequence
from datetime import datetime
from functools import lru_cache

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519

from gateway.authorization.caller import Caller, NotAuthorised, Role
from gateway.authorization.credential import CertificateCredential, Challenge, RequestStatement, make_statement
from gateway.pki.inspect import CertificateError, check_issued, identity_of, is_signed, parse_certificate

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
