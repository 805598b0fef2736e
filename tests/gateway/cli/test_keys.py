"""What `plumbline keys` advises is what keeps a person in command."""

import shlex
from datetime import timedelta
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.errors import BAD_INPUT
from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import Site


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "keys")


def keys(site: Site, *arguments: str) -> int:
    return main(["keys", *arguments, "--folder", str(site.folder.path)])


def states(site: Site, name: str) -> list[bool]:
    """Of the certificates of a name in their order, whether they are revoked."""
    return [one.revoked for one in site.folder.issued() if one.identity.name == name]


def test_the_advice_of_a_renewal_revokes_the_certificate_before_alone(
    site: Site, capsys: pytest.CaptureFixture[str]
) -> None:
    site.issue("ann", Holder.SERVICE, utc_now() - timedelta(days=1))
    assert keys(site, "renew", "ann") == 0
    advice = capsys.readouterr().out.split("until plumbline ")[1].split(",")[0]
    assert main([*shlex.split(advice), "--folder", str(site.folder.path)]) == 0
    told = capsys.readouterr().out
    assert states(site, "ann") == [True, False]
    assert "1 certificate of ann revoked" in told
    assert "WARNING" not in told
    assert keys(site, "revoke", "ann", "--keep-newest") == BAD_INPUT
    assert "no valid certificate before its newest" in capsys.readouterr().err


def test_who_revokes_the_newest_certificate_along_with_others_is_warned(
    site: Site, capsys: pytest.CaptureFixture[str]
) -> None:
    site.issue("ann", Holder.SERVICE, utc_now() - timedelta(days=1))
    keys(site, "renew", "ann")
    capsys.readouterr()
    assert keys(site, "revoke", "ann") == 0
    told = capsys.readouterr().out
    assert "2 certificates of ann revoked" in told
    assert "WARNING: the newest is among them, and ann has no valid certificate now" in told
    assert states(site, "ann") == [True, True]
