"""The CA of a site: certificates and the revocation list that it signs, and the folder with its key and what it has issued.

The folder also has one of files for each holder. Time is an argument.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from gateway.atomic_io import write_durably, write_private
from gateway.errors import InputError
from gateway.pki.inspect import CertificateError, CertificateIdentity, identity_of, parse_certificate, revoked_serials

BACKDATED = timedelta(days=1)
"""A certificate is valid from a day before it is made: the clocks of gateways are not all right."""
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")
CA_NAME, CA_KEY_NAME, REVOKED_NAME = "ca.pem", "ca-key.pem", "revoked.pem"
CERTIFICATE_NAME, KEY_NAME = "certificate.pem", "key.pem"
ISSUED = "issued"
PRIVATE, PUBLIC = 0o600, 0o644
PEM = serialization.Encoding.PEM


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


@dataclass(frozen=True, slots=True)
class IssuedCertificate:
    """A certificate that the CA has issued."""

    identity: CertificateIdentity
    certificate: x509.Certificate
    revoked: bool


class SiteFolder:
    """The CA of a site, in a folder that belongs on a machine of the site's own, not on a gateway."""

    def __init__(self, path: Path) -> None:
        """Open the folder. Raises `InputError` where it is none."""
        self.path = path
        try:
            certificate = parse_certificate((path / CA_NAME).read_bytes())
            key = serialization.load_pem_private_key((path / CA_KEY_NAME).read_bytes(), password=None)
        except (OSError, ValueError, CertificateError) as error:
            raise InputError(f"{path}: is not the folder of a CA; plumbline keys init makes one") from error
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise InputError(f"{path / CA_KEY_NAME}: is not a key that plumbline keys init makes")
        self._authority = KeyPair(certificate, key)

    @classmethod
    def create(cls, path: Path, site: str, days: int, now: datetime) -> "SiteFolder":
        """Make the CA of a site. Raises `InputError` where there is one."""
        if (path / CA_KEY_NAME).exists():
            raise InputError(f"{path}: has a CA already; issue certificates with it, or choose another folder")
        authority = make_authority(site, days, now)
        write_private(path / CA_KEY_NAME, _key_pem(authority.key), PRIVATE)
        write_durably(path / CA_NAME, authority.certificate.public_bytes(PEM))
        folder = cls(path)
        folder._write_revoked([], now)
        return folder

    @property
    def identity(self) -> CertificateIdentity:
        """What the CA's own certificate states."""
        return identity_of(self._authority.certificate)

    def issue(self, name: str, holder: Holder, hosts: Iterable[str], days: int, now: datetime) -> Path:
        """Issue a certificate; return the folder with its files. Raises `InputError` where the name has one, or is none."""
        if self._valid(name, now):
            raise InputError(f"{name} has a certificate; plumbline keys renew {name} makes a new one")
        return self._write_holder(name, holder, hosts, days, now)

    def renew(self, name: str, days: int, now: datetime) -> Path:
        """Issue a certificate with a new key for a holder; the one before is valid until it expires or is revoked."""
        before = [one for one in self.issued() if one.identity.name == name]
        if not before:
            raise InputError(f"{name} has no certificate of this CA; plumbline keys list names those that have")
        newest = max(before, key=lambda one: one.identity.valid_from)
        hosts = _hosts(newest.certificate)
        return self._write_holder(name, Holder(newest.identity.holder), hosts, days, now)

    def revoke(self, name: str, now: datetime, *, keep_newest: bool = False) -> int:
        """Put the certificates of a name on the revocation list; return how many. Raises `InputError` where there is none."""
        serials = [one.identity.serial for one in self._valid(name, now)]
        if keep_newest and len(serials) == 1:
            raise InputError(f"{name} has no valid certificate before its newest, which --keep-newest spares")
        if keep_newest:
            del serials[-1:]
        if not serials:
            raise InputError(f"{name} has no certificate that is valid; plumbline keys list names those that have")
        listed = x509.load_pem_x509_crl((self.path / REVOKED_NAME).read_bytes())
        before = [(entry.serial_number, entry.revocation_date_utc) for entry in listed]
        self._write_revoked([*before, *((serial, now) for serial in serials)], now)
        return len(serials)

    def issued(self) -> list[IssuedCertificate]:
        """Return everything that the CA has issued, by name and time. Raises `InputError` for a damaged file."""
        found = []
        try:
            revoked = revoked_serials((self.path / REVOKED_NAME).read_bytes(), [self._authority.certificate])
            for path in sorted((self.path / ISSUED).glob("*.pem")):
                certificate = parse_certificate(path.read_bytes())
                identity = identity_of(certificate)
                found.append(IssuedCertificate(identity, certificate, identity.serial in revoked))
        except (OSError, CertificateError) as error:
            raise InputError(f"{self.path}: {error}; restore the folder from its copy") from error
        return sorted(found, key=lambda one: (one.identity.name, one.identity.valid_from))

    def _valid(self, name: str, now: datetime) -> list[IssuedCertificate]:
        return [
            one
            for one in self.issued()
            if one.identity.name == name and not one.revoked and one.identity.valid_until > now
        ]

    def _write_holder(self, name: str, holder: Holder, hosts: Iterable[str], days: int, now: datetime) -> Path:
        days_left = (self._authority.certificate.not_valid_after_utc - now).days
        if days > days_left:
            raise InputError(f"the CA is valid for {days_left} more days; choose --days of at most that")
        try:
            pair = issue(self._authority, name, holder, hosts, days, now)
        except ValueError as error:
            raise InputError(f"{name}: cannot be certified: {error}") from error
        folder = self.path / f"{holder}-{name}"
        if folder.exists():
            old = parse_certificate((folder / CERTIFICATE_NAME).read_bytes())
            folder.rename(folder.with_name(f"{folder.name}.before-{old.serial_number & 0xFFFFFFFF:08x}"))
        write_private(folder / KEY_NAME, _key_pem(pair.key), PRIVATE)
        pem = pair.certificate.public_bytes(PEM)
        write_durably(folder / CERTIFICATE_NAME, pem)
        write_durably(folder / CA_NAME, (self.path / CA_NAME).read_bytes())
        write_durably(folder / REVOKED_NAME, (self.path / REVOKED_NAME).read_bytes())
        write_durably(self.path / ISSUED / f"{holder}-{name}-{pair.certificate.serial_number:x}.pem", pem)
        return folder

    def _write_revoked(self, revoked: Sequence[tuple[int, datetime]], now: datetime) -> None:
        listed = make_revocation_list(self._authority, revoked, now)
        write_durably(self.path / REVOKED_NAME, listed.public_bytes(PEM))


def utc_now() -> datetime:
    """Return the present time to the second, as certificates state it."""
    return datetime.now(UTC).replace(microsecond=0)


def _hosts(certificate: x509.Certificate) -> list[str]:
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return [str(name.value) for name in names]


def _key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
