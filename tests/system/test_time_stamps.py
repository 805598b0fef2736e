"""Time stamps of an authority outside prove recordings against the holder of the gateway's key, to those who heard nothing."""

import base64
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.ports import unused_port
from tests.system.conftest import ROOT, JoinBus, Plumbline, RunningGateway, StartGateway
from tests.system.time_stamp_authority import make_authority, openssl
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is pinned and nothing was heard."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "nobody"))


@contextmanager
def authority(folder: Path, port: int) -> Iterator[None]:
    program = [sys.executable, "-m", "tests.system.time_stamp_authority", str(folder), str(port)]
    process = subprocess.Popen(program, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield
    finally:
        process.kill()
        process.communicate()


UNSTAMPED = {"PLUMBLINE_RECORDER__SEGMENT_S": "5", "PLUMBLINE_GATEWAY__SITE": "yard"}


def settings(port: int) -> dict[str, str]:
    return {
        **UNSTAMPED,
        "PLUMBLINE_RECORDER__TIME_STAMP_AUTHORITY": f"http://127.0.0.1:{port}/tsa",
        "PLUMBLINE_RECORDER__TIME_STAMP_EVERY_S": "1",
    }


def stamps(gateway: RunningGateway) -> list[str]:
    path = gateway.data_dir / "time-stamps.jsonl"
    return path.read_text().splitlines() if path.exists() else []


def test_a_time_stamp_proves_what_the_holder_of_the_key_writes_again(
    start_gateway: StartGateway, join_bus: JoinBus, plumbline: Plumbline, tmp_path: Path
) -> None:
    port, ca = unused_port(), make_authority(tmp_path / "tsa")
    with authority(tmp_path / "tsa", port):
        gateway = start_gateway(environment=settings(port))
        wait_until(lambda: len(stamps(gateway)) >= 2, "two time stamps")
        gateway.stop()
    folder, kept = gateway.data_dir, tmp_path / "kept.jsonl"
    key = (folder / "signing-key.pem.pub").read_text().strip()
    shutil.copy(folder / "time-stamps.jsonl", kept)
    verify = "record", "verify", folder, "--key", key
    proven = plumbline(*verify, "--tsa-ca", ca)
    assert (proven.returncode, proven.stderr) == (0, ""), proven.stdout
    assert "segment 1, and all before it, existed on 20" in proven.stdout
    assert "are not checked; give the certificate" in plumbline(*verify).stdout
    stranger = plumbline(*verify, "--tsa-ca", make_authority(tmp_path / "other"))
    assert (stranger.returncode, "existed on" in stranger.stdout) == (0, False)
    assert "time stamps are not valid" in stranger.stdout
    check_by_openssl(json.loads(stamps(gateway)[0]), ca, tmp_path)

    for path in [*folder.glob("*.mcap"), folder / "chain.json", folder / "time-stamps.jsonl"]:
        path.unlink()  # the holder of the key records something else
    again = start_gateway(environment=UNSTAMPED)
    join_bus(again.endpoint).wait_for("health", lambda message: message["newest_statement"])
    again.stop()
    assert plumbline(*verify, "--tsa-ca", ca).returncode == 0  # who kept nothing cannot know
    rewritten = plumbline(*verify, "--tsa-ca", ca, "--time-stamps", kept)
    assert (rewritten.returncode, "REWRITTEN: " in rewritten.stdout) == (1, True), rewritten.stdout


def check_by_openssl(stamp: dict[str, object], ca: Path, folder: Path) -> None:
    """Another program finds the same."""
    statement, response = stamp["statement"], folder / "stamp.tsr"
    assert isinstance(statement, dict)
    (folder / "stamped").write_text(statement["sha256"])
    response.write_bytes(base64.b64decode(str(stamp["response"])))
    openssl("ts", "-verify", "-data", folder / "stamped", "-in", response, "-CAfile", ca)


def test_an_authority_that_does_not_answer_is_a_fault_and_delays_nothing(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    gateway = start_gateway(environment=settings(unused_port()))
    peer = join_bus(gateway.endpoint)
    health = peer.wait_for("health", lambda message: "time_stamps" in message["standing_faults"])
    assert "no time stamp" in health["standing_faults"]["time_stamps"]
    assert (health["lost"], health["recording_error"]) == (0, None)
    code, _ = gateway.stop()
    assert code == 0
