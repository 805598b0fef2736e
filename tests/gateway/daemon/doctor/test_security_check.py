"""`plumbline doctor --security`: what is open beyond this machine is bad, and says what to do."""

from pathlib import Path

import pytest

from gateway.configuration.bus_section import find_problems
from gateway.configuration.loading import validate
from gateway.daemon.doctor.security_check import examine_security
from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import Site

Table = dict[str, object]


def bad(table: Table) -> list[str]:
    """Return the texts of what is open."""
    return [result.text for result in examine_security(validate(table, "test")) if result.grade == "bad"]


def with_tls(site: Site, name: str, **bus: object) -> Table:
    folder = site.folder.path / name
    files = {"ca": "ca.pem", "certificate": "certificate.pem", "key": "key.pem", "revoked": "revoked.pem"}
    return {"bus": {"tls": {key: str(folder / file) for key, file in files.items()}, **bus}}


@pytest.fixture
def site(tmp_path: Path) -> Site:
    made = Site(tmp_path / "keys")
    made.folder.issue("crane-1", Holder.GATEWAY, [], 400, utc_now())
    made.issue("ann", Holder.SERVICE, days=20)
    return made


def test_the_default_is_open_to_nobody_beyond_the_machine(tmp_path: Path) -> None:
    assert bad({"gateway": {"data_dir": str(tmp_path)}}) == []


def test_a_site_with_certificates_is_closed(site: Site, tmp_path: Path) -> None:
    table = with_tls(site, "gateway-crane-1", listen=["tls/0.0.0.0:7447"], connect=["tls/10.0.0.1:7447"])
    assert bad({"gateway": {"data_dir": str(tmp_path)}, **table}) == []


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"bus": {"listen": ["tcp/0.0.0.0:7447"], "allow_unencrypted": True}}, "everyone on the network may read"),
        ({"bus": {"connect": ["tcp/10.0.0.1:7447"]}}, "unencrypted over the network; connect to tls/"),
        ({"page": {"listen": "0.0.0.0:8321"}}, "use ssh -L, or a TLS proxy"),
    ],
)
def test_what_is_open_is_named_with_the_remedy(table: Table, said: str) -> None:
    assert any(said in text for text in bad(table))


def test_a_token_that_everybody_may_read_is_bad(tmp_path: Path) -> None:
    token = tmp_path / "command-token"
    token.write_text("00" * 32)
    token.chmod(0o644)
    (text,) = bad({"gateway": {"data_dir": str(tmp_path)}})
    assert text.endswith(f"correct: chmod 0640 {token}")


def test_a_certificate_that_expires_soon_is_bad(site: Site) -> None:
    (text,) = bad(with_tls(site, "service-ann"))
    assert "19 days left; plumbline keys renew" in text


def test_a_certificate_that_vouches_for_no_key_of_this_gateway_is_named(site: Site) -> None:
    def said(crane: str) -> list[str]:
        table = {**with_tls(site, "gateway-crane-1"), "gateway": {"crane": crane}}
        found = examine_security(validate(table, "test"))
        return [result.text for result in found if "does not vouch" in result.text]

    assert said("crane-1") == []
    (text,) = said("crane-2")
    assert "is that of crane-1, not of crane-2 or crane-2.hook-1" in text


@pytest.mark.slow
def test_damaged_missing_mixed_and_revoked_files_are_named(site: Site, tmp_path: Path) -> None:
    crane, ann = site.folder.path / "gateway-crane-1", site.folder.path / "service-ann"
    files = {"ca": crane / "ca.pem", "certificate": crane / "certificate.pem", "key": crane / "key.pem"}
    assert list(find_problems(files)) == []
    stranger = Site(tmp_path / "other").issue("crane-1", Holder.GATEWAY)
    damaged = tmp_path / "damaged.pem"
    damaged.write_bytes(b"-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n")
    for change, said in (
        ({"key": ann / "key.pem"}, "is not the key of"),
        ({"key": crane / "no-such.pem"}, "cannot be read"),
        ({"certificate": stranger / "certificate.pem"}, "was not issued by"),
        ({"certificate": damaged}, "is not a certificate"),
        ({"ca": damaged}, "has no certificate"),
        ({"key": damaged}, "is not an unencrypted private key"),
        ({"revoked": damaged}, "is not a revocation list"),
    ):
        (problem,) = find_problems({**files, **change})
        assert said in problem
    site.folder.revoke("crane-1", utc_now())
    (problem,) = find_problems({**files, "revoked": site.folder.path / "revoked.pem"})
    assert "was revoked" in problem
