"""Reading and checking of certificates and revocation lists, and of the content of the files of mutual TLS."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from gateway.errors import PlumblineError

SIGNING_KEYS = (ec.EllipticCurvePublicKey, ed25519.Ed25519PublicKey)


class CertificateError(PlumblineError):
    """A certificate or a list of them cannot be used; the text states why in one line."""


@dataclass(frozen=True, slots=True)
class CertificateIdentity:
    """What a certificate says of its holder."""

    name: str
    holder: str
    """gateway, router, operator or service; empty where the certificate states none."""
    serial: int
    valid_from: datetime
    valid_until: datetime


def parse_certificate(pem: bytes) -> x509.Certificate:
    """Return the certificate in a PEM text. Raises `CertificateError`."""
    try:
        return x509.load_pem_x509_certificate(pem)
    except ValueError as error:
        raise CertificateError("is not a certificate in PEM") from error


def parse_authorities(pem: bytes) -> tuple[x509.Certificate, ...]:
    """Return the CA certificates in a PEM text: more than one while a site changes its CA. Raises `CertificateError`."""
    try:
        return tuple(x509.load_pem_x509_certificates(pem))
    except ValueError as error:
        raise CertificateError("has no certificate in PEM") from error


def identity_of(certificate: x509.Certificate) -> CertificateIdentity:
    """Return what a certificate says of its holder. Raises `CertificateError` where it has no common name."""
    name = _attribute(certificate, NameOID.COMMON_NAME)
    if not name:
        raise CertificateError("has no common name")
    return CertificateIdentity(
        name=name,
        holder=_attribute(certificate, NameOID.ORGANIZATIONAL_UNIT_NAME),
        serial=certificate.serial_number,
        valid_from=certificate.not_valid_before_utc,
        valid_until=certificate.not_valid_after_utc,
    )


def check_issued(certificate: x509.Certificate, authorities: Sequence[x509.Certificate], now: datetime) -> None:
    """Refuse what no CA has issued for a client, or what is not valid at a time. Raises `CertificateError`."""
    ca = next((one for one in authorities if _has_issued(one, certificate)), None)
    if ca is None:
        raise CertificateError("was not issued by this site's CA")
    try:
        purposes = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        is_ca = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except (x509.ExtensionNotFound, ValueError) as error:
        raise CertificateError("does not state its purpose") from error
    if is_ca or ExtendedKeyUsageOID.CLIENT_AUTH not in purposes:
        raise CertificateError("is not that of a client")
    for one in (certificate, ca):
        if not one.not_valid_before_utc <= now <= one.not_valid_after_utc:
            what = "is" if one is certificate else "was issued by a CA that is"
            raise CertificateError(
                f"{what} valid from {one.not_valid_before_utc:%Y-%m-%d} to {one.not_valid_after_utc:%Y-%m-%d} only"
            )


def is_signed(certificate: x509.Certificate, content: bytes, signature: bytes) -> bool:
    """Return whether the holder of a certificate has signed a content."""
    key = certificate.public_key()
    try:
        if isinstance(key, ed25519.Ed25519PublicKey):
            key.verify(signature, content)
        elif isinstance(key, ec.EllipticCurvePublicKey):
            key.verify(signature, content, ec.ECDSA(hashes.SHA256()))
        else:
            return False
    except InvalidSignature:
        return False
    return True


def revoked_serials(pem: bytes, authorities: Sequence[x509.Certificate]) -> frozenset[int]:
    """Return the serial numbers on a revocation list. Raises `CertificateError` where no CA has signed it."""
    try:
        listed = x509.load_pem_x509_crl(pem)
        keys = [ca.public_key() for ca in authorities if ca.subject == listed.issuer]
        signed = any(isinstance(key, SIGNING_KEYS) and listed.is_signature_valid(key) for key in keys)
    except (ValueError, TypeError) as error:
        raise CertificateError("is not a revocation list in PEM") from error
    if not signed:
        raise CertificateError("was not signed by this site's CA")
    return frozenset(entry.serial_number for entry in listed)


def _has_issued(ca: x509.Certificate, certificate: x509.Certificate) -> bool:
    try:
        certificate.verify_directly_issued_by(ca)
    except (InvalidSignature, ValueError, TypeError):
        return False
    return True


def _attribute(certificate: x509.Certificate, oid: x509.ObjectIdentifier) -> str:
    values = certificate.subject.get_attributes_for_oid(oid)
    return str(values[0].value) if len(values) == 1 else ""


def find_content_problems(files: Mapping[str, Path]) -> Iterator[str]:
    """Yield what is wrong with the content of readable files, one line each."""
    try:
        authorities = parse_authorities(files["ca"].read_bytes())
    except CertificateError as error:
        yield f"bus.tls.ca: {files['ca']}: {error}"
        return
    try:
        certificate = parse_certificate(files["certificate"].read_bytes())
        check_issued(certificate, authorities, datetime.now(UTC))
    except CertificateError as error:
        yield f"bus.tls.certificate: {files['certificate']}: {error}"
        return
    try:
        key = serialization.load_pem_private_key(files["key"].read_bytes(), password=None)
        if key.public_key() != certificate.public_key():
            yield f"bus.tls.key: {files['key']}: is not the key of {files['certificate']}"
    except (ValueError, TypeError):
        yield f"bus.tls.key: {files['key']}: is not an unencrypted private key in PEM"
    if "revoked" in files:
        try:
            revoked = revoked_serials(files["revoked"].read_bytes(), authorities)
        except CertificateError as error:
            yield f"bus.tls.revoked: {files['revoked']}: {error}"
        else:
            if certificate.serial_number in revoked:
                yield f"bus.tls.certificate: {files['certificate']}: was revoked; plumbline keys renew makes a new one"
