"""What somebody heard of a gateway proves its recordings: the key at the first contact, and the hash of the newest statement."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.system.conftest import JoinBus, Plumbline, StartGateway

SHORT = {"PLUMBLINE_RECORDER__SEGMENT_S": "10", "PLUMBLINE_GATEWAY__SITE": "yard"}
Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(tmp_path: Path, plumbline: Plumbline) -> Run:
    """`plumbline` as a user with a home of its own."""

    def run(*arguments: str | Path) -> tuple[int, str]:
        done = plumbline(*arguments, environment={"XDG_STATE_HOME": str(tmp_path / "state")})
        return done.returncode, done.stdout + done.stderr

    return run


@pytest.mark.slow
def test_who_listened_proves_what_the_holder_of_the_key_writes_again(
    start_gateway: StartGateway, join_bus: JoinBus, run: Run, tmp_path: Path
) -> None:
    gateway = start_gateway(environment=SHORT)
    peer = join_bus(gateway.endpoint)
    said = peer.wait_for("health", lambda message: message["newest_statement"])["newest_statement"]
    assert said["segment"] == 1
    kept = tmp_path / "kept.json"
    code, _ = run("remote", "status", "--connect", gateway.endpoint, "--json", kept)
    assert code == 0
    gateway.stop()
    folder = gateway.data_dir
    assert run("record", "verify", folder)[0] == 0  # by the pinned key
    assert "pinned: this user heard it" in run("record", "verify", folder)[1]

    first, *others = sorted(folder.glob("*.mcap"))
    for path in others:
        path.unlink()
    (folder / "chain.json").unlink()
    shutil.copytree(folder, tmp_path / "again")
    first.unlink()  # the holder of the key records something else
    again = start_gateway(environment=SHORT)
    join_bus(again.endpoint).wait_for("health", lambda message: message["newest_statement"])
    again.stop()
    code, text = run("record", "verify", folder, "--key", (folder / "signing-key.pem.pub").read_text().strip())
    assert (code, "REWRITTEN: " in text) == (1, True), text
    key = (folder / "signing-key.pem.pub").read_text().strip()
    shutil.rmtree(tmp_path / "state")
    assert run("record", "verify", folder, "--key", key)[0] == 0  # who heard nothing cannot know
    code, text = run("record", "verify", folder, "--key", key, "--heard", kept)
    assert (code, "REWRITTEN: " in text) == (1, True), text
