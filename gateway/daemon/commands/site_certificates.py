"""The certificate files of a gateway: what commands are checked with, and when its own certificate expires."""

import logging
import time
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509

from gateway.authorization.certificates import CertificateVerifier, Voucher, certificate_names, make_voucher
from gateway.configuration.bus_section import EXPIRES_SOON_DAYS, TlsSection
from gateway.pki.inspect import (
    CertificateError,
    CertificateIdentity,
    identity_of,
    parse_authorities,
    parse_certificate,
    revoked_serials,
)

log = logging.getLogger("plumbline.security")
LOOK_S, WARNING_S = 3600.0, 86_400.0
"""Time between two looks at the certificates, and between two warnings. Basis: a choice; certificates last for months, and a
warning a day is read."""
NOTHING_REVOKED: frozenset[int] = frozenset()


def utc_now() -> datetime:
    """Return the time of the wall clock."""
    return datetime.now(UTC)


class SiteCertificates:
    """Reads the files of `bus.tls`; the revocation list again whenever it has changed."""

    def __init__(self, tls: TlsSection) -> None:
        self._tls = tls
        self._authorities: tuple[x509.Certificate, ...] = ()
        self._list_version: tuple[int, int] | None = None
        self._revoked = NOTHING_REVOKED
        self.expires_in_days: int | None = None
        """Days until the gateway's own certificate expires, at the last look; None: not known."""
        self._next_look_s = self._next_warning_s = 0.0
        self._voucher: tuple[str, Voucher | None] | None = None
        """For which key it was made; None: the files cannot be used."""

    def voucher(self, gateway: str, public_key: str) -> Voucher | None:
        """Return what vouches for the gateway's signing key; None where the files cannot be used, and why is logged.

        It is made once from the files, as the links are: another certificate is used from the next start on.
        """
        if self._voucher is None or self._voucher[0] != public_key:
            try:
                made = make_voucher(_read(self._tls.certificate), _read(self._tls.key), gateway, public_key)
            except (CertificateError, ValueError, TypeError) as error:  # `TypeError`: the key is encrypted
                log.error("bus.tls: nothing vouches for the signing key: %s", error)
                made = None
            self._voucher = public_key, made
        return self._voucher[1]

    def verifier(self) -> CertificateVerifier:
        """Return what checks the callers' certificates. Raises `CertificateError` for a CA file that cannot be used."""
        self._authorities = parse_authorities(_read(self._tls.ca))
        return CertificateVerifier(self._authorities, self.revoked, utc_now)

    def revoked(self) -> frozenset[int]:
        """Return the revoked serial numbers. Raises `CertificateError` where the list is configured and cannot be used."""
        if self._tls.revoked is None:
            return NOTHING_REVOKED
        try:
            status = self._tls.revoked.stat()
        except OSError as error:
            raise CertificateError(f"cannot be read ({error.strerror})") from error
        version = (status.st_mtime_ns, status.st_size)
        if version != self._list_version:
            self._revoked = revoked_serials(_read(self._tls.revoked), self._authorities)
            self._list_version = version
        return self._revoked

    def watch_expiry(self) -> None:
        """Read once an hour when the certificate expires, and warn of it in the log once a day. It waits for the disk."""
        now_s = time.monotonic()
        if now_s >= self._next_look_s:
            self._next_look_s = now_s + LOOK_S
            self.expires_in_days = self.days_left()
        days = self.expires_in_days
        soon = days is not None and days < EXPIRES_SOON_DAYS
        if soon and now_s >= self._next_warning_s:
            self._next_warning_s = now_s + WARNING_S
            log.warning("bus.tls.certificate expires in %s days; plumbline keys renew makes a new one", days)

    def days_left(self) -> int | None:
        """Return the days until the gateway's own certificate expires; None where it cannot be read."""
        identity = self._identity()
        return None if identity is None else (identity.valid_until - utc_now()).days

    def other_name(self, gateway: str) -> str | None:
        """Return whose the gateway's own certificate is, and should be, where it names another; None: it does not."""
        identity, names = self._identity(), certificate_names(gateway)
        if identity is None or identity.name in names:
            return None
        return f"{self._tls.certificate} is that of {identity.name}, not of {' or '.join(names)}"

    def _identity(self) -> CertificateIdentity | None:
        try:
            return identity_of(parse_certificate(_read(self._tls.certificate)))
        except CertificateError:
            return None


def _read(path: Path | None) -> bytes:
    if path is None:
        raise CertificateError("is not configured")
    try:
        return path.read_bytes()
    except OSError as error:
        raise CertificateError(f"{path}: cannot be read ({error.strerror})") from error
