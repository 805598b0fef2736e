"""The certificate of an OPC UA server, checked before it serves: a client that refuses it later tells nobody why."""

from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey
from cryptography.hazmat.primitives.serialization import load_der_private_key, load_pem_private_key

from gateway.errors import InputError
from gateway.file_input import read_bounded, reason_of

MADE_BY = "docs/guides/integrator/plant.md has the line of openssl that makes one"


def load_x509(path: Path, setting: str) -> x509.Certificate:
    """Return a certificate of either form; `setting` names it in the settings. Raises `InputError`."""
    try:
        content = read_bounded(path)
        return x509.load_pem_x509_certificate(content) if _is_text(content) else x509.load_der_x509_certificate(content)
    except (OSError, ValueError) as error:
        raise InputError(f"{setting}: {path} is no certificate (PEM or DER): {reason_of(error)}") from error


def check_identity(certificate: Path, key: Path) -> str:
    """Return the application URI in a certificate that every client can use with its key. Raises `InputError`."""
    found, private = load_x509(certificate, "opcua.certificate"), _load_key(key)
    where = f"opcua.certificate: {certificate}"
    if private.public_key() != found.public_key():
        raise InputError(f"opcua.key: {key} is not the key of {certificate}; name the two that were made together")
    now = datetime.now(UTC)
    if not found.not_valid_before_utc <= now <= found.not_valid_after_utc:
        raise InputError(
            f"{where} is valid from {found.not_valid_before_utc:%Y-%m-%d} to {found.not_valid_after_utc:%Y-%m-%d}, "
            "and not now; look at the clock, or have another one issued"
        )
    try:
        names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        return names.get_values_for_type(x509.UniformResourceIdentifier)[0]
    except (x509.ExtensionNotFound, IndexError, ValueError):
        raise InputError(f"{where} names no application URI, which clients compare; {MADE_BY}") from None


def _load_key(path: Path) -> RSAPrivateKey:
    try:
        content = read_bounded(path)
        loaded = load_pem_private_key(content, None) if _is_text(content) else load_der_private_key(content, None)
    except (OSError, ValueError, TypeError) as error:  # TypeError: it is encrypted
        raise InputError(f"opcua.key: {path} is no private key without a password: {reason_of(error)}") from error
    if not isinstance(loaded, RSAPrivateKey):
        raise InputError(f"opcua.key: {path} is no RSA key, as OPC UA needs; {MADE_BY}")
    return loaded


def _is_text(content: bytes) -> bool:
    return content.lstrip().startswith(b"-----")
