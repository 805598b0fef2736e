"""Whatever becomes of the files that a gateway keeps over its restarts: it starts, samples, alerts, and says what it lost."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.system.bus_query import KEY
from tests.system.conftest import ROOT, JoinBus, StartGateway
from tests.waiting import PATIENCE_S

Damage = Callable[[Path], object]

MADE_LATER = (
    "calibration/simulated-1/drift.json",
    "calibration/simulated-1/in_force.json",
    "security.jsonl",
    "time-stamps.jsonl",
    "page-pin",
    "calibration/audit.jsonl",
    "calibration/session.json",
    "configuration/trial.json",
    "configuration/commissioned.json",
)
"""Files that a gateway makes when something happens."""


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    if content:
        content[len(content) // 2] ^= 0x80
    path.write_bytes(content)


def become(kind: Callable[[Path], None]) -> Damage:
    def damage(path: Path) -> None:
        path.unlink()
        kind(path)

    return damage


DAMAGES: dict[str, Damage] = {
    "removed": Path.unlink,
    "empty": lambda path: path.write_bytes(b""),
    "cut": lambda path: os.truncate(path, path.stat().st_size // 2),
    "not UTF-8": flip,
    "noise": lambda path: path.write_bytes(b"\x00\xff{[" * 300),
    "deep": lambda path: path.write_bytes(b"[" * 100_000),
    "a link to nothing": become(lambda path: path.symlink_to("nowhere")),
    "a link to a device": become(lambda path: path.symlink_to("/dev/zero")),
    "a folder": become(Path.mkdir),
    "a pipe": become(os.mkfifo),
    "of another user": lambda path: os.chown(path, 65534, 65534) if os.geteuid() == 0 else path.chmod(0),
}


@pytest.fixture(scope="module")
def former(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data folder of a gateway that was stopped, with every file that it keeps."""
    folder = tmp_path_factory.mktemp("former") / "data"
    environment = {
        **os.environ,
        "PLUMBLINE_GATEWAY__DATA_DIR": str(folder),
        "PLUMBLINE_BUS__LISTEN": "[]",
        "PLUMBLINE_PAGE__LISTEN": "127.0.0.1:0",
        "PLUMBLINE_RECORDER__SEGMENT_S": "10",
    }
    command = [sys.executable, "-m", "gateway", "run", "--duration", "14"]
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    return folder


def state_files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".mcap"]


def make_later_files(folder: Path) -> None:
    for path in (folder / name for name in MADE_LATER if not (folder / name).exists()):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("{}\n")


@pytest.mark.slow
@pytest.mark.parametrize("damage", list(DAMAGES))
def test_a_gateway_works_with_all_its_state_files_damaged(
    former: Path, start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path, damage: str
) -> None:
    folder = tmp_path / "data"
    shutil.copytree(former, folder, symlinks=True)
    make_later_files(folder)
    damaged = state_files(folder)
    assert {"chain.json", "command-token", "signing-key.pem", ".lock"} <= {path.name for path in damaged}
    for path in damaged:
        DAMAGES[damage](path)
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    health = peer.wait_for("health", lambda message: message["samples"] > 0)
    assert health["state"] == "running"
    peer.wait_for("alert")
    code, output = gateway.stop()
    assert code in (0, 3), output
    assert "Traceback" not in output, output
    assert gateway.recordings[len(list(former.glob("*.mcap"))) :], output
    if damage not in ("of another user", "removed"):
        assert "chain.json: " in output, output


@pytest.mark.slow
def test_a_link_in_place_of_a_state_file_changes_nothing_where_it_leads(
    former: Path, start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    """Each leads to a file that is right, so that the gateway might go on with it: it may read there, and not write."""
    folder, elsewhere = tmp_path / "data", tmp_path / "elsewhere"
    shutil.copytree(former, folder, symlinks=True)
    elsewhere.mkdir()
    victims = {}
    make_later_files(folder)
    for number, path in enumerate(state_files(folder)):
        victim = elsewhere / f"{number}-{path.name}"
        path.rename(victim)
        path.symlink_to(victim)
        victims[victim] = victim.read_bytes(), victim.stat().st_mode
    gateway = start_gateway(environment={"PLUMBLINE_RECORDER__SEGMENT_S": "10"})
    peer = join_bus(gateway.endpoint)
    peer.wait_for("alert")
    refused = peer.session.get(f"{KEY}/rpc/recalibrate", payload=b"{}", timeout=PATIENCE_S)
    assert [reply.ok for reply in refused] == [None]  # it is noted in security.jsonl
    peer.wait_for("health", lambda message: message["newest_statement"])
    code, output = gateway.stop()
    assert code in (0, 3), output
    assert "Traceback" not in output, output
    changed = [path.name for path, kept in victims.items() if (path.read_bytes(), path.stat().st_mode) != kept]
    assert changed == [], output
    assert len(victims) > len(MADE_LATER)
