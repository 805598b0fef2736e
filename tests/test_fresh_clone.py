"""What the first commands of the README do to a fresh clone: one installation, and nothing that git would show."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LOCKS = ["requirements-twin.lock", "requirements-dev.lock"]


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """The files of the installation, with a command that is installed already."""
    (tmp_path / "script").mkdir()
    shutil.copy(ROOT / "script" / "setup", tmp_path / "script")
    for name in [*LOCKS, "pyproject.toml", ".gitignore"]:
        shutil.copy(ROOT / name, tmp_path)
    command = tmp_path / ".venv" / "bin" / "plumbline"
    command.parent.mkdir(parents=True)
    command.touch(mode=0o755)
    return tmp_path


def _setup(clone: Path, purpose: str) -> subprocess.CompletedProcess[str]:
    """Run the script with no means to install anything."""
    (clone / ".venv" / "bin" / "python").write_text("#!/bin/sh\nexit 9\n")
    (clone / ".venv" / "bin" / "python").chmod(0o755)
    return subprocess.run([clone / "script" / "setup", purpose], capture_output=True, text=True, check=False)


def _note_installed(clone: Path, lock: str) -> None:
    content = (clone / lock).read_bytes() + (clone / "pyproject.toml").read_bytes()
    checksum = subprocess.run(["cksum"], input=content, capture_output=True, check=True).stdout
    (clone / ".venv" / f"installed-{lock}").write_bytes(checksum)


def test_what_the_tests_need_is_installed_once_and_is_enough_to_run(clone: Path) -> None:
    _note_installed(clone, "requirements-dev.lock")
    for purpose in ("test", "run"):
        ended = _setup(clone, purpose)
        assert (ended.returncode, ended.stderr) == (0, ""), purpose
    (clone / "requirements-dev.lock").write_text("")  # another state of the clone
    assert "making .venv from requirements-twin.lock" in _setup(clone, "run").stderr


def test_what_runs_is_not_enough_for_the_tests(clone: Path) -> None:
    _note_installed(clone, "requirements-twin.lock")
    assert _setup(clone, "run").returncode == 0
    assert "making .venv from requirements-dev.lock" in _setup(clone, "test").stderr


def test_the_lock_of_the_tests_holds_all_that_is_needed_to_run() -> None:
    run, test = (set(re.findall(r"(?m)^[\w.-]+==\S+", (ROOT / name).read_text())) for name in LOCKS)
    assert run <= test


def test_git_shows_neither_recordings_nor_reports_of_incidents(clone: Path) -> None:
    subprocess.run(["git", "init", "--quiet", clone], check=True)
    for name in ("plumbline-data", "incident-20261122T073000Z"):
        (clone / name).mkdir()
        (clone / name / "file").touch()
    shown = subprocess.run(["git", "-C", clone, "status", "--short"], capture_output=True, text=True, check=True)
    assert "plumbline-data" not in shown.stdout
    assert "incident" not in shown.stdout
