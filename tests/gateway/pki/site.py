"""The certificates of a site, made by the command line's own code."""

from datetime import datetime, timedelta
from pathlib import Path

from gateway.authorization.certificates import Voucher, make_voucher
from gateway.pki.site_folder import Holder, SiteFolder, utc_now

DAYS = 30


def vouch(folder: Path, gateway: str, public_key: str) -> Voucher:
    """What the holder of a folder says of a key, whoever that is."""
    certificate, key = ((folder / name).read_bytes() for name in ("certificate.pem", "key.pem"))
    return make_voucher(certificate, key, gateway, public_key)


class Site:
    """A CA in a folder, and the folders of its holders."""

    def __init__(self, path: Path) -> None:
        self.folder = SiteFolder.create(path, "yard", 3650, utc_now())

    def issue(self, name: str, holder: Holder, now: datetime | None = None, days: int = DAYS) -> Path:
        return self.folder.issue(name, holder, [], days, now or utc_now())

    def expired(self, name: str, holder: Holder) -> Path:
        """A certificate that expired yesterday."""
        return self.issue(name, holder, utc_now() - timedelta(days=DAYS + 1))

    def gateway_toml(self, name: str = "crane-1") -> str:
        """The section of a gateway's configuration."""
        folder = self.issue(name, Holder.GATEWAY)
        revoked = self.folder.path / "revoked.pem"
        return (
            f'[bus.tls]\nca = "{folder / "ca.pem"}"\ncertificate = "{folder / "certificate.pem"}"\n'
            f'key = "{folder / "key.pem"}"\nrevoked = "{revoked}"\n'
        )
