"""Files of a running gateway are closed to other users, and what runs as root follows no link that its user has made."""

import os
import tarfile
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.file_input import read_owned
from tests.system.conftest import JoinBus, StartGateway


@pytest.mark.slow
def test_nobody_outside_the_group_reads_a_file_and_only_the_owner_locks(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    previous = os.umask(0o000)  # the most permissive surroundings
    try:
        lock = tmp_path / "data" / ".lock"
        lock.parent.mkdir(mode=0o750)
        lock.touch(mode=0o644)  # of a former version
        gateway = start_gateway(page=True)
        join_bus(gateway.endpoint).wait_for("health", lambda message: message["recording"])
        gateway.stop()
    finally:
        os.umask(previous)
    modes = {path.name: path.lstat().st_mode & 0o777 for path in gateway.data_dir.rglob("*")}
    assert any(name.endswith(".mcap") for name in modes)
    assert {name for name, mode in modes.items() if mode & 0o027} == {"signing-key.pem.pub"}, modes
    assert modes[".lock"] == modes["signing-key.pem"] == 0o600


@pytest.mark.slow
def test_the_bundle_contains_no_file_to_which_a_link_leads(tmp_path: Path) -> None:
    data, foreign = tmp_path / "data", tmp_path / "elsewhere"
    foreign.mkdir()
    (foreign / "audit.jsonl").write_text("root:$6$of-another-user\n")
    (data / "calibration").mkdir(parents=True)
    (data / "calibration" / "audit.jsonl").symlink_to(foreign / "audit.jsonl")
    assert b"of-another-user" not in bundled(data, tmp_path / "first.tar.gz")
    (data / "calibration" / "audit.jsonl").unlink()
    (data / "calibration").rmdir()
    (data / "calibration").symlink_to(foreign)
    assert b"of-another-user" not in bundled(data, tmp_path / "second.tar.gz")
    (data / "calibration").unlink()
    (data / "calibration").mkdir()
    (data / "calibration" / "audit.jsonl").write_text("its own\n")
    assert b"its own" in bundled(data, tmp_path / "third.tar.gz")


def bundled(data_dir: Path, out: Path) -> bytes:
    """The content of the files of a bundle."""
    config = out.with_suffix(".toml")
    config.write_text(f'[gateway]\ndata_dir = "{data_dir}"\n[bus]\nlisten = []\n[page]\nenabled = false\n')
    main(["doctor", "--bundle", str(out), "--config", str(config)])
    with tarfile.open(out) as archive:
        members = [archive.extractfile(member) for member in archive.getmembers()]
        return b"".join(member.read() for member in members if member is not None)


def test_a_long_file_is_read_from_its_end(tmp_path: Path) -> None:
    (tmp_path / "audit.jsonl").write_bytes(b"first\n" + b"last\n")
    assert read_owned(tmp_path, "audit.jsonl", max_bytes=5) == b"last\n"
