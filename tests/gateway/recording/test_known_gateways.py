"""What somebody has heard of a gateway counts when its recordings are verified."""

import json
from pathlib import Path
from typing import Any

import pytest

from gateway.bus.known_gateways import known_statement, remember_statement
from gateway.cli.main import main
from gateway.messages import NewestStatement
from tests.gateway.recording.conftest import GATEWAY, Record


@pytest.mark.slow
def test_segments_at_the_end_are_missed_as_far_as_somebody_heard(
    record: Record, start_ns: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def run(*arguments: str | Path) -> tuple[int, str]:
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return code, said.out + said.err

    paths = record(start_ns)
    folder = paths[0].parent
    state = json.loads((folder / "chain.json").read_text())
    heard: dict[str, Any] = {"segment": 3, "sha256": state["final_sha256"], "gateway": GATEWAY, "public_key": "00" * 32}
    kept = tmp_path / "kept.jsonl"
    kept.write_text(json.dumps({"x": 1}) + "\n" + json.dumps({"health": {"newest_statement": heard}}) + "\n")
    key = folder / "signing-key.pem.pub"
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
