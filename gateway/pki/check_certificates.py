"""The content of the files of mutual TLS: who issued the certificate, whether the key is its own, and until when it is valid."""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from cryptography.hazmat.primitives import serialization

from gateway.pki.inspect import (
    CertificateError,
    check_issued,
    parse_authorities,
    parse_certificate,
    revoked_serials,
)


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
