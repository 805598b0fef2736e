"""Recordings are genuine by the CA of the site alone, and not by another CA, for another gateway, or with another key.

What somebody has heard of a gateway counts too when its recordings are verified.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from gateway.bus.known_gateways import known_statement, remember_statement
from gateway.cli.main import main
from gateway.cli.record.known_key import key_of_recordings
from gateway.incident.record_verdict import judge_recordings
from gateway.messages import NewestStatement
from gateway.pki.signing_key import fingerprint, load_or_create_key
from gateway.pki.site_folder import Holder, utc_now
from gateway.recording.format.content import RecordingHeader
from tests.clocks import START_NS
from tests.gateway.pki.site import Site, vouch
from tests.gateway.recording.conftest import GATEWAY, Record
from tests.values import present


class Vouching:
    """What vouches for the key of the recorder under test."""

    def __init__(self, data_dir: Path) -> None:
        self.key = present(load_or_create_key(data_dir / "signing-key.pem"))
        self.text: str | None = None

    def by(self, folder: Path, public_key: str | None = None) -> None:
        self.text = vouch(folder, GATEWAY, public_key or self.key.public_hex).model_dump_json()


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "keys")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    return folder


@pytest.fixture
def vouching(data: Path) -> Vouching:
    return Vouching(data)


@pytest.fixture
def header(header: RecordingHeader, vouching: Vouching) -> RecordingHeader:
    return replace(header, voucher=lambda: vouching.text)


@pytest.fixture(autouse=True)
def _nothing_pinned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def verify(site: Site, *arguments: Path | str) -> int:
    return main(["record", "verify", *map(str, arguments), "--ca", str(site.folder.path / "ca.pem")])


def test_recordings_are_genuine_by_the_ca_alone_each_segment_by_itself(
    site: Site, vouching: Vouching, record: Record, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vouching.by(site.issue("crane-2", Holder.GATEWAY))
    paths = record(START_NS)
    for given, code in ((data, 0), *((path, 3) for path in paths)):  # a file is an extract
        assert verify(site, given) == code
        said = capsys.readouterr().out
        signer = fingerprint(vouching.key.public_hex)
        assert f"the site's CA vouches for the key {signer} of {GATEWAY}" in said
        assert said.endswith(f"(key {signer}, vouched for by the site's CA)\n")
    with paths[0].open("rb") as file:
        assert "voucher.json" in {each.name for each in make_reader(file).iter_attachments()}
    assert main(["record", "verify", str(data)]) == 3


def test_planted_forgeries_are_refused(
    site: Site, vouching: Vouching, record: Record, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forgeries: tuple[tuple[Path, str], ...] = (
        (Site(tmp_path / "other").issue("crane-2", Holder.GATEWAY), "not issued by this site's CA"),
        (site.issue("crane-1", Holder.GATEWAY), "is that of crane-1, not of crane-2"),
        (site.issue("router-1", Holder.ROUTER), "not that of a gateway"),
        (site.expired("crane-2", Holder.GATEWAY), "valid from"),
    )
    for number, (folder, part) in enumerate(forgeries):
        vouching.by(folder)
        to = tmp_path / str(number)
        shutil.copytree(data, to)
        record(START_NS, folder=to, segments=1)
        assert verify(site, to) == 1, part
        told = capsys.readouterr().out
        assert "NOT VOUCHED FOR: " in told
        assert part in told


def test_a_forger_who_signs_again_keeps_no_voucher(
    site: Site, vouching: Vouching, record: Record, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vouching.by(site.issue("crane-2", Holder.GATEWAY), public_key="0" * 64)  # as if the key had been another one
    record(START_NS, segments=1)
    assert verify(site, data) == 1
    assert "does not vouch for this key" in capsys.readouterr().out


def test_without_a_voucher_the_ca_proves_nothing(
    site: Site, vouching: Vouching, record: Record, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(START_NS, segments=1)
    assert verify(site, data) == 3
    assert "no segment has a voucher" in capsys.readouterr().out
    assert verify(site, data, "--key", vouching.key.public_hex) == 0


def test_a_revoked_certificate_vouches_for_no_recording(
    site: Site, vouching: Vouching, record: Record, data: Path
) -> None:
    vouching.by(site.issue("crane-2", Holder.GATEWAY))
    record(START_NS, segments=1)
    assert verify(site, data) == 0
    site.folder.revoke("crane-2", utc_now())
    assert verify(site, data) == 1


def test_a_key_that_is_given_must_be_right_beside_the_ca(
    site: Site, vouching: Vouching, record: Record, data: Path
) -> None:
    vouching.by(site.issue("crane-2", Holder.GATEWAY))
    record(START_NS, segments=1)
    assert verify(site, data, "--key", vouching.key.public_hex) == 0
    assert verify(site, data, "--key", "ab" * 32) == 1


def test_a_report_of_an_incident_judges_by_the_same_keys(
    site: Site, vouching: Vouching, record: Record, data: Path
) -> None:
    vouching.by(site.issue("crane-2", Holder.GATEWAY))
    paths = record(START_NS, segments=1)

    def judged(ca: Path | None) -> tuple[str, str]:
        known = key_of_recordings(None, ca, paths)
        refusal = None if known.vouched is None else known.vouched.refusal
        verdict = judge_recordings(paths, known.public_key, said_by=known.said_by, refusal=refusal)
        return verdict.kind, verdict.sentences[0]

    ca = site.folder.path / "ca.pem"
    assert judged(None)[0] == "open"
    vouched = f"The site’s CA vouches for this key of {GATEWAY}: {vouching.key.public_hex}."
    assert judged(ca) == ("genuine", vouched)
    site.folder.revoke("crane-2", utc_now())
    kind, why = judged(ca)
    assert kind == "differs"
    assert "revoked" in why
    heard = NewestStatement(gateway=GATEWAY, segment=1, sha256="0" * 64, public_key=vouching.key.public_hex)
    assert remember_statement(heard) is None
    heard_it = f"Who made this report heard this key from the gateway at the first contact: {vouching.key.public_hex}."
    assert judged(None) == ("genuine", heard_it)


def test_a_file_that_is_no_ca_is_named(
    site: Site, record: Record, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(START_NS, segments=1)
    for given in (tmp_path / "nothing.pem", data / "signing-key.pem"):
        assert main(["record", "verify", str(data), "--ca", str(given)]) == 2
        assert f"--ca {given}: " in capsys.readouterr().err


@pytest.mark.slow
def test_segments_at_the_end_are_missed_as_far_as_somebody_heard(
    record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def run(*arguments: str | Path) -> tuple[int, str]:
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return code, said.out + said.err

    paths = record(START_NS)
    folder = paths[0].parent
    state = json.loads((folder / "chain.json").read_text())
    heard: dict[str, Any] = {"segment": 3, "sha256": state["final_sha256"], "gateway": GATEWAY, "public_key": "00" * 32}
    kept = tmp_path / "kept.jsonl"
    kept.write_text(json.dumps({"x": 1}) + "\n" + json.dumps({"health": {"newest_statement": heard}}) + "\n")
    key = (folder / "signing-key.pem.pub").rename(tmp_path / "kept.pub")
    assert run("record", "verify", folder, "--key", key, "--heard", kept)[0] == 0
    paths[2].unlink()
    (folder / "chain.json").unlink()
    code, text = run("record", "verify", folder, "--key", key, "--heard", kept)
    assert code == 1
    assert "REMOVED: segment 3 is missing at the end" in text
    code, text = run("record", "verify", folder, "--heard", key)
    assert (code, "is no JSON" in text or "has no newest_statement" in text) == (2, True), text


def test_another_key_than_the_pinned_one_is_named(tmp_path: Path) -> None:
    environment = {"XDG_STATE_HOME": str(tmp_path)}
    first = NewestStatement(gateway="yard/a/b", segment=4, sha256="0" * 64, public_key="11" * 32)
    assert remember_statement(first, environment) is None
    other = NewestStatement(gateway="yard/a/b", segment=5, sha256="0" * 64, public_key="22" * 32)
    said = remember_statement(other, environment)
    assert said is not None
    assert said.startswith("WRONG KEY: yard/a/b signs")
    assert known_statement("yard/a/b", environment) == first
    for damaged in (b"", b"\xff", b"{}", b"[" * 10_000):
        (path,) = (tmp_path / "plumbline" / "gateways").iterdir()
        path.write_bytes(damaged)
        assert known_statement("yard/a/b", environment) is None
