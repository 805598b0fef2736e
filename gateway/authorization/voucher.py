"""The voucher of a gateway: what its certificate of the site's CA says of the key that signs what it sends and records.

The gateway makes it by itself, with the key of that certificate. So the CA vouches for the signing key at one remove: for the
holder of the certificate, who vouches for the key.
"""

import json
from collections.abc import Sequence
from datetime import datetime

from cryptography import x509
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.authorization.certificates import load_key, sign
from gateway.pki.inspect import CertificateError, check_issued, identity_of, is_signed, parse_certificate
from gateway.pki.issue import Holder


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
