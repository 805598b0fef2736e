"""The CA of a site vouches at the door of an archive for keys that nobody has written down."""

import json
from pathlib import Path
from typing import Any

import pytest

from gateway.cli.main import main
from gateway.errors import BAD_INPUT
from gateway.pki.signing_key import load_or_create_key
from gateway.pki.site_folder import Holder
from tests.gateway.archive.small_recordings import SmallCrane
from tests.gateway.pki.site import Site, vouch
from tests.values import present


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "site")


@pytest.fixture
def crane(site: Site, tmp_path: Path) -> SmallCrane:
    """A crane whose gateway has a certificate of the site."""
    folder = tmp_path / "source" / "crane-1"
    folder.mkdir(parents=True)
    crane = SmallCrane(folder, segments=1)
    key = present(load_or_create_key(folder / "signing-key.pem")).public_hex
    certified = site.issue("crane-1", Holder.GATEWAY)
    crane.voucher = vouch(certified, crane.gateway, key).model_dump_json()
    return crane.record()


def read(crane: SmallCrane, capsys: pytest.CaptureFixture[str], *options: Path | str) -> list[dict[str, Any]]:
    """Index and return what was read."""
    capsys.readouterr()
    source = crane.folder.parent
    table = source.parent / "table"
    assert main(["archive", "index", str(source), "--into", str(table), "--json", "-", *map(str, options)]) == 0
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["read"]
    return found


@pytest.mark.slow
def test_what_the_ca_vouches_for_is_verified_although_it_was_indexed_before(
    crane: SmallCrane, site: Site, capsys: pytest.CaptureFixture[str]
) -> None:
    assert [each["trust"] for each in read(crane, capsys)] == ["consistent"]
    ca = site.folder.path / "ca.pem"
    assert [(each["trust"], each["status"]) for each in read(crane, capsys, "--ca", ca)] == [("verified", "counted")]
    assert read(crane, capsys, "--ca", ca) == []
    table = crane.folder.parents[1] / "table"
    assert main(["archive", "verify", str(crane.folder.parent), "--table", str(table)]) == 0
    assert "1 genuine" in capsys.readouterr().out


@pytest.mark.slow
def test_what_another_ca_does_not_vouch_for_says_why_and_is_asked_once(
    crane: SmallCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = Site(tmp_path / "other").folder.path / "ca.pem"
    (found,) = read(crane, capsys, "--ca", other)
    assert found["trust"] == "consistent"
    assert "NOT VOUCHED FOR" in found["reason"]
    assert read(crane, capsys, "--ca", other) == []


def test_a_file_that_is_no_ca_is_named(crane: SmallCrane, capsys: pytest.CaptureFixture[str]) -> None:
    given = crane.folder / "signing-key.pem"
    table = crane.folder.parents[1] / "table"
    arguments = ["archive", "index", str(crane.folder), "--into", str(table), "--ca", str(given)]
    assert main(arguments) == BAD_INPUT
    assert f"--ca {given}" in capsys.readouterr().err
