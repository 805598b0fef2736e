"""The Debian package by dpkg itself, in a folder and without root: install, upgrade, rollback, failures, remove, purge."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway import __version__

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
OLD, NEW = f"{__version__}-1", f"{__version__}-2"
SETTINGS = '[gateway]\nsite = "yard"\ndemonstration = true\n'

Completed = subprocess.CompletedProcess[str]


def _program(path: Path, text: str) -> Path:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """`script/deb` without a package index: `pip` installs nothing, and the packaged program is that of this tree."""
    folder = tmp_path_factory.mktemp("packages")
    pip = _program(folder / "pip", "exit 0")
    python = _program(folder / "python", f'PYTHONPATH={ROOT} exec {sys.executable} "$@"')

    def run(*arguments: str) -> Path:
        done = subprocess.run(
            ["sh", str(ROOT / "script" / "deb"), "--out", str(folder), *arguments],
            env={**os.environ, "PYTHON": str(pip), "TARGET_PYTHON": str(python)},
            capture_output=True,
            text=True,
            check=True,
        )
        return Path(done.stdout.strip())

    return run


@pytest.fixture(scope="module")
def old(build: Callable[..., Path]) -> Path:
    """The version before."""
    return build("--revision", "1")


@pytest.fixture(scope="module")
def new(build: Callable[..., Path]) -> Path:
    """The version to upgrade to."""
    return build("--revision", "2")


class Machine:
    """A root directory with dpkg's database."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.settings = root / "etc" / "plumbline" / "plumbline.toml"
        self.recording = root / "var" / "lib" / "plumbline" / "one.mcap"

    def dpkg(self, *arguments: str | Path, **environment: str) -> Completed:
        """Run dpkg without root; its scripts act on the folder."""
        options = [f"--root={self.root}", "--force-not-root", "--force-script-chrootless", "--force-depends"]
        return subprocess.run(
            ["dpkg", *options, f"--log={self.root}/dpkg.log", *map(str, arguments)],
            env={**os.environ, "PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin", **environment},
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    def roll_back(self) -> Completed:
        """Run rollback.sh of the current release."""
        return subprocess.run(
            ["sh", str(self.root / "opt/plumbline/current/deploy/rollback.sh")],
            env={**os.environ, "PLUMBLINE_ROOT": str(self.root)},
            capture_output=True,
            text=True,
            check=False,
        )

    @property
    def current(self) -> str:
        return (self.root / "opt" / "plumbline" / "current").resolve().name


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, old: Path) -> Path:
    """The root directory of a machine with the old version, settings and a recording."""
    root = tmp_path_factory.mktemp("installed") / "root"
    for name in ("info", "updates", "triggers"):
        (root / "var" / "lib" / "dpkg" / name).mkdir(parents=True)
    (root / "var" / "lib" / "dpkg" / "status").touch()
    machine = Machine(root)
    done = machine.dpkg("-i", old)
    assert done.returncode == 0, done.stderr
    assert "make them: sudo plumbline setup" in done.stdout
    machine.settings.write_text(SETTINGS)
    machine.recording.write_bytes(b"samples")
    return root


@pytest.fixture
def machine(tmp_path: Path, installed: Path) -> Machine:
    """A copy of that machine."""
    return Machine(shutil.copytree(installed, tmp_path / "root", symlinks=True))


def test_the_package_has_the_same_parts_as_the_installer(machine: Machine) -> None:
    for place, part in (
        ("usr/lib/systemd/system/plumbline.service", "plumbline.service"),
        ("usr/lib/udev/rules.d/60-plumbline.rules", "60-plumbline.rules"),
        ("etc/default/plumbline", "service.env"),
        ("usr/bin/plumbline", "plumbline.sh"),
    ):
        assert (machine.root / place).read_text() == (ROOT / "deploy" / part).read_text()
    assert (machine.root / "usr/bin/plumbline").stat().st_mode & 0o777 == 0o755
    assert machine.current == OLD


def test_the_arm64_package_is_for_that_processor(build: Callable[..., Path]) -> None:
    package = build("--arch", "arm64")
    done = subprocess.run(
        ["dpkg-deb", "--field", str(package), "Architecture", "Depends"], capture_output=True, text=True, check=True
    )
    assert "Architecture: arm64" in done.stdout
    assert "python3.11" in done.stdout


def test_an_upgrade_and_rollbacks_keep_settings_and_recordings(machine: Machine, new: Path) -> None:
    assert machine.dpkg("-i", new).returncode == 0
    assert machine.current == NEW
    for expected in (f"{OLD}-kept", NEW):
        done = machine.roll_back()
        assert done.returncode == 0, done.stderr
        assert machine.current == expected
        assert (machine.root / "opt/plumbline/current/.venv/bin/python").exists()
    assert machine.settings.read_text() == SETTINGS
    assert machine.recording.exists()


def test_an_upgrade_does_not_touch_the_running_version_where_the_settings_are_wrong(
    machine: Machine, new: Path
) -> None:
    machine.settings.write_text("[rope]\nlenght_m = 12.0\n")
    done = machine.dpkg("-i", new)
    assert done.returncode != 0
    assert "did you mean length_m" in done.stderr
    assert machine.current == f"{OLD}-kept"
    assert (machine.root / "opt/plumbline/current/config/adxl355.toml").exists()
    machine.settings.write_text(SETTINGS)
    assert machine.dpkg("--configure", "-a").returncode == 0
    assert machine.current == NEW


def test_a_downgrade_is_an_upgrade_to_the_old_version(machine: Machine, old: Path, new: Path) -> None:
    for package, expected in ((new, NEW), (old, OLD), (old, OLD)):
        assert machine.dpkg("-i", package).returncode == 0
        assert machine.current == expected


def test_an_edited_environment_of_the_service_stays(machine: Machine, new: Path) -> None:
    environment = machine.root / "etc" / "default" / "plumbline"
    environment.write_text("PLUMBLINE_GATEWAY__DATA_DIR=/srv/plumbline\n")
    assert machine.dpkg("-i", new).returncode == 0
    assert environment.read_text() == "PLUMBLINE_GATEWAY__DATA_DIR=/srv/plumbline\n"


def test_the_package_and_the_installer_refuse_each_other(machine: Machine, new: Path) -> None:
    refused = subprocess.run(
        ["sh", str(ROOT / "deploy" / "install.sh")],
        env={**os.environ, "PLUMBLINE_ROOT": str(machine.root)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert refused.returncode == 2
    assert "the Debian package plumbline-gateway is installed" in refused.stderr
    unit = machine.root / "etc" / "systemd" / "system" / "plumbline.service"
    unit.parent.mkdir(parents=True)
    unit.touch()
    done = machine.dpkg("-i", new)
    assert done.returncode != 0
    assert "uninstall.sh --keep-data" in done.stderr
    assert machine.current == OLD


def test_only_a_confirmed_purge_deletes_recordings(machine: Machine, new: Path) -> None:
    assert machine.dpkg("--remove", "plumbline-gateway").returncode == 0
    assert not (machine.root / "opt" / "plumbline").exists()
    kept = machine.dpkg("--purge", "plumbline-gateway")
    assert kept.returncode == 0, kept.stderr
    assert "kept" in kept.stdout
    assert machine.recording.exists()
    assert machine.settings.exists()
    assert machine.dpkg("-i", new).returncode == 0
    assert machine.current == NEW
    assert machine.dpkg("--purge", "plumbline-gateway", PLUMBLINE_DELETE_DATA="yes").returncode == 0
    assert not machine.recording.exists()
    assert not machine.settings.exists()
