"""The folder of a CA: private keys stay private, nothing is overwritten without a word, revocation lasts."""

import stat
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography import x509

from gateway.errors import InputError
from gateway.pki.inspect import CertificateError, check_issued, identity_of, parse_certificate, revoked_serials
from gateway.pki.site_folder import Holder, SiteFolder, utc_now
from tests.gateway.pki.site import DAYS, Site


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "keys")


def authorities(site: Site) -> list[x509.Certificate]:
    return [parse_certificate((site.folder.path / "ca.pem").read_bytes())]


def certificate(folder: Path) -> x509.Certificate:
    return parse_certificate((folder / "certificate.pem").read_bytes())


def test_every_private_key_can_be_read_by_its_owner_alone(site: Site) -> None:
    site.issue("ann", Holder.SERVICE)
    keys = list(site.folder.path.rglob("*key.pem"))
    assert len(keys) == 2
    assert {stat.S_IMODE(path.stat().st_mode) for path in keys} == {0o600}


def test_a_certificate_states_name_role_and_the_addresses_of_a_gateway(site: Site) -> None:
    made = certificate(site.folder.issue("crane-1", Holder.GATEWAY, ["10.0.0.5", "crane.example"], DAYS, utc_now()))
    identity = identity_of(made)
    assert (identity.name, identity.holder) == ("crane-1", "gateway")
    names = made.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert {str(name.value) for name in names} == {"10.0.0.5", "crane.example", "localhost", "127.0.0.1", "::1"}
    check_issued(made, authorities(site), utc_now())


def test_what_another_ca_issued_or_is_expired_or_not_valid_yet_is_refused(site: Site, tmp_path: Path) -> None:
    stranger = Site(tmp_path / "other").issue("ann", Holder.SERVICE)
    with pytest.raises(CertificateError, match="not issued by"):
        check_issued(certificate(stranger), authorities(site), utc_now())
    made = certificate(site.issue("ann", Holder.SERVICE))
    for now in (utc_now() + timedelta(days=DAYS + 1), utc_now() - timedelta(days=2)):
        with pytest.raises(CertificateError, match="valid from"):
            check_issued(made, authorities(site), now)
    with pytest.raises(CertificateError, match="does not state its purpose"):
        check_issued(authorities(site)[0], authorities(site), utc_now())


def test_a_second_certificate_of_a_name_needs_a_renewal_which_keeps_the_old_files(site: Site) -> None:
    first = site.issue("ann", Holder.SERVICE)
    old = (first / "key.pem").read_bytes()
    with pytest.raises(InputError, match="keys renew ann"):
        site.issue("ann", Holder.SERVICE)
    renewed = site.folder.renew("ann", DAYS, utc_now() + timedelta(seconds=5))
    assert renewed == first
    assert (renewed / "key.pem").read_bytes() != old
    (kept,) = site.folder.path.glob("service-ann.before-*")
    assert (kept / "key.pem").read_bytes() == old
    with pytest.raises(InputError, match="has a CA already"):
        SiteFolder.create(site.folder.path, "yard", 10, utc_now())


def test_revocations_add_up_and_a_renewed_certificate_may_stay(site: Site, tmp_path: Path) -> None:
    ann, bob = (certificate(site.issue(name, Holder.SERVICE)).serial_number for name in ("ann", "bob"))
    site.folder.revoke("ann", utc_now())
    renewed = certificate(site.folder.renew("bob", DAYS, utc_now() + timedelta(seconds=5))).serial_number
    site.folder.revoke("bob", utc_now() + timedelta(seconds=6), keep_newest=True)
    listed = (site.folder.path / "revoked.pem").read_bytes()
    assert revoked_serials(listed, authorities(site)) == {ann, bob}
    assert renewed not in {ann, bob}
    with pytest.raises(InputError, match="no certificate that is valid"):
        site.folder.revoke("ann", utc_now())
    with pytest.raises(CertificateError, match="not signed by"):
        revoked_serials(listed, authorities(Site(tmp_path / "other")))


def test_a_certificate_never_outlives_its_ca(site: Site) -> None:
    with pytest.raises(InputError, match="choose --days"):
        site.issue("ann", Holder.SERVICE, days=4000)
