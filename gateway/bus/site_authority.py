"""The CA of a site as a receiver knows it: whether it vouches for the key of a gateway."""

from datetime import UTC, datetime
from pathlib import Path

from gateway.authorization.voucher import check_voucher, parse_voucher
from gateway.pki.inspect import CertificateError, parse_authorities, revoked_serials


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
