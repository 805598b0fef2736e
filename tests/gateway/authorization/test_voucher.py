"""A key is that of a gateway where the CA's certificate of that gateway says so today, and for no other key, gateway or CA."""

from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gateway.authorization.certificates import SiteAuthority
from gateway.pki.signing_key import SigningKey
from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import DAYS, Site
from tests.gateway.pki.site import vouch as make

CRANE_1 = "plumbline/v1/yard/crane-1/hook-1"
CRANE_2 = "plumbline/v1/yard/crane-2/hook-1"
KEY, OTHER_KEY = (SigningKey(Ed25519PrivateKey.generate()).public_hex for _ in range(2))


def vouch(folder: Path, gateway: str = CRANE_1, public_key: str = KEY) -> dict[str, Any]:
    return make(folder, gateway, public_key).model_dump()


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "keys")


@pytest.fixture
def authority(site: Site) -> SiteAuthority:
    return SiteAuthority(site.folder.path / "ca.pem", site.folder.path / "revoked.pem")


@pytest.mark.parametrize("name", ["crane-1", "crane-1.hook-1"])
def test_the_certificate_of_a_crane_or_of_one_sensor_of_it_vouches(
    site: Site, authority: SiteAuthority, name: str
) -> None:
    assert authority.refuse(CRANE_1, KEY, vouch(site.issue(name, Holder.GATEWAY))) is None


def test_a_renewed_certificate_vouches_too(site: Site, authority: SiteAuthority) -> None:
    site.issue("crane-1", Holder.GATEWAY, now=utc_now() - timedelta(days=1))
    renewed = site.folder.renew("crane-1", DAYS, utc_now())
    site.folder.revoke("crane-1", utc_now(), keep_newest=True)
    assert authority.refuse(CRANE_1, KEY, vouch(renewed)) is None


def test_planted_forgeries_are_refused_with_what_is_wrong(site: Site, authority: SiteAuthority, tmp_path: Path) -> None:
    own = site.issue("crane-1", Holder.GATEWAY)
    other_ca = Site(tmp_path / "other").issue("crane-1", Holder.GATEWAY)
    second = site.issue("crane-2", Holder.GATEWAY)
    right = vouch(own)
    forged: dict[str, object] = {
        "was not issued by this site's CA": vouch(other_ca),
        "is that of crane-2, not of crane-1 or crane-1.hook-1": vouch(second),
        "only": vouch(site.expired("old.hook-1", Holder.GATEWAY)),
        "is not that of a gateway, but that of router crane-1.x": vouch(site.issue("crane-1.x", Holder.ROUTER)),
        "but that of service ann": vouch(site.issue("ann", Holder.SERVICE)),
        "does not vouch for this key": vouch(own, public_key=OTHER_KEY),
        "does not vouch for this key of this gateway": vouch(own, gateway=CRANE_1.replace("yard", "quay")),
        "has a voucher that cannot be read": {**right, "signature": "zz"},
        "voucher that cannot be read": {**right, "more": 1},
    }
    for part, voucher in forged.items():
        assert part in str(authority.refuse(CRANE_1, KEY, voucher)), part
    for voucher in (None, [], "x", {**right, "certificate": "x" * 4097}):
        assert authority.refuse(CRANE_1, KEY, voucher) is not None
    stolen = {**right, "certificate": vouch(second)["certificate"]}
    assert authority.refuse(CRANE_2, KEY, stolen) is not None  # another's certificate, without its key
    assert authority.refuse(CRANE_1, KEY, right) is None


def test_an_expired_certificate_vouches_no_more(site: Site, authority: SiteAuthority) -> None:
    expired = site.expired("crane-1", Holder.GATEWAY)
    assert "valid from" in str(authority.refuse(CRANE_1, KEY, vouch(expired)))


def test_a_revoked_certificate_vouches_no_more_and_a_damaged_list_lets_none_vouch(
    site: Site, authority: SiteAuthority
) -> None:
    voucher = vouch(site.issue("crane-1", Holder.GATEWAY))
    assert authority.refuse(CRANE_1, KEY, voucher) is None
    site.folder.revoke("crane-1", utc_now())
    assert "was revoked" in str(authority.refuse(CRANE_1, KEY, voucher))
    (site.folder.path / "revoked.pem").write_text("damaged")
    assert "revocation list" in str(authority.refuse(CRANE_1, KEY, voucher))
    (site.folder.path / "ca.pem").unlink()
    assert "cannot be read" in str(authority.refuse(CRANE_1, KEY, voucher))
