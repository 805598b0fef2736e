"""Certificates and the revocation list, signed by the CA of a site. Time is an argument."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from ipaddress import ip_address

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

BACKDATED = timedelta(days=1)
"""A certificate is valid from a day before it is made: the clocks of gateways are not all right."""
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")


class Holder(StrEnum):
    """What the holder of a certificate is; for people it is their role."""

    GATEWAY = "gateway"
    ROUTER = "router"
    OPERATOR = "operator"
    SERVICE = "service"


@dataclass(frozen=True, slots=True)
class KeyPair:
    """A certificate with its private key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def make_authority(site: str, days: int, now: datetime) -> KeyPair:
    """Return a new CA whose certificate is valid for some days."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"{site} CA")])
    usage = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=True,
        encipher_only=False,
        decipher_only=False,
    )
    builder = _builder(name, name, key.public_key(), days, now)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(usage, critical=True)
    return KeyPair(builder.sign(key, hashes.SHA256()), key)


def issue(authority: KeyPair, name: str, holder: Holder, hosts: Iterable[str], days: int, now: datetime) -> KeyPair:
    """Return a new certificate for TLS in both directions and for signing requests, with its key.

    `hosts` are addresses and names under which it is reached; those of its own machine are added for gateways and routers.
    Raises `ValueError` for a name or host that a certificate cannot have.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name(
        [
            x509.NameAttribute(NameOID.COMMON_NAME, name),
            x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, holder.value),
        ]
    )
    local = LOCAL_HOSTS if holder in (Holder.GATEWAY, Holder.ROUTER) else ()
    names = [_general_name(host) for host in dict.fromkeys((*hosts, *local))]
    builder = _builder(subject, authority.certificate.subject, key.public_key(), days, now)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    purposes = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    builder = builder.add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
    builder = builder.add_extension(x509.SubjectAlternativeName(names or [_general_name(name)]), critical=False)
    return KeyPair(builder.sign(authority.key, hashes.SHA256()), key)


def make_revocation_list(
    authority: KeyPair, revoked: Sequence[tuple[int, datetime]], now: datetime
) -> x509.CertificateRevocationList:
    """Return the list of the serial numbers of certificates that were revoked, with their times.

    It is valid as long as the CA: a gateway without a connection keeps the last one that it was given.
    """
    builder = x509.CertificateRevocationListBuilder(
        issuer_name=authority.certificate.subject,
        last_update=now,
        next_update=authority.certificate.not_valid_after_utc,
    )
    for serial, at in revoked:
        entry = x509.RevokedCertificateBuilder().serial_number(serial).revocation_date(at).build()
        builder = builder.add_revoked_certificate(entry)
    return builder.sign(authority.key, hashes.SHA256())


def _builder(
    subject: x509.Name, issuer: x509.Name, public_key: ec.EllipticCurvePublicKey, days: int, now: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(now + timedelta(days=days))
    )


def _general_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(host))
    except ValueError:
        return x509.DNSName(host)
