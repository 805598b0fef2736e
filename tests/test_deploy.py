"""The service unit is one that systemd accepts, and is locked down; the installer refuses clearly."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
UNIT = ROOT / "deploy" / "plumbline.service"
BRIDGE_UNIT = ROOT / "deploy" / "plumbline-bridge@.service"
PROPOSE_UNIT = ROOT / "deploy" / "plumbline-propose.service"
UNITS = [
    (UNIT, UNIT.name),
    (BRIDGE_UNIT, "plumbline-bridge@mqtt.service"),
    (PROPOSE_UNIT, PROPOSE_UNIT.name),
    (PROPOSE_UNIT.with_suffix(".timer"), "plumbline-propose.timer"),
]
MOST_EXPOSURE = 2.0

Completed = subprocess.CompletedProcess[str]


@pytest.fixture
def analyze() -> Callable[..., Completed]:
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.fail(
            "systemd-analyze is missing: the service file cannot be tested; mend: apt install systemd", pytrace=False
        )

    def run(*arguments: str | Path) -> Completed:
        return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)

    return run


@pytest.mark.slow
@pytest.mark.parametrize(("source", "name"), UNITS)
def test_systemd_accepts_the_unit(analyze: Callable[..., Completed], tmp_path: Path, source: Path, name: str) -> None:
    unit = tmp_path / name
    # The program is not installed here: any executable stands in for it.
    unit.write_text(source.read_text().replace("/opt/plumbline/current/.venv/bin/python", sys.executable))
    done = analyze("verify", "--man=no", unit)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("unit", [UNIT, BRIDGE_UNIT, PROPOSE_UNIT])
def test_the_sandbox_is_tight(analyze: Callable[..., Completed], unit: Path) -> None:
    done = analyze("security", "--offline=true", unit)
    exposure = re.search(r"exposure level for plumbline\S*.service: ([\d.]+)", done.stdout)
    assert exposure is not None, done.stdout + done.stderr
    assert float(exposure[1]) <= MOST_EXPOSURE


def test_the_watchdog_is_fed_often_enough() -> None:
    """A read takes at most half a second, a pause before reopening at most five."""
    text = UNIT.read_text()
    assert "Type=notify" in text
    seconds = re.search(r"^WatchdogSec=(\d+)$", text, re.MULTILINE)
    assert seconds is not None
    assert int(seconds[1]) >= 10


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python whose package index is not there: `pip` installs nothing, and the program is that of this tree."""
    program = tmp_path_factory.mktemp("python") / "python"
    program.write_text(
        f"""#!/bin/sh
case "$*" in
"-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
"-m pip "*) exit ${{PIP_EXIT:-0}} ;;
*) PYTHONPATH={ROOT} exec {sys.executable} "$@" ;;
esac
"""
    )
    program.chmod(0o755)
    return program


class Installation:
    """An installation in another root directory."""

    def __init__(self, root: Path, python: Path) -> None:
        self.root = root
        self.settings = root / "etc" / "plumbline" / "plumbline.toml"
        self.releases = root / "opt" / "plumbline" / "releases"
        self._environment = {**os.environ, "PLUMBLINE_ROOT": str(root), "PYTHON": str(python)}

    def run(self, script: str, *arguments: str | Path, **environment: str) -> Completed:
        return subprocess.run(
            ["sh", str(ROOT / "deploy" / script), *map(str, arguments)],
            env={**self._environment, **environment},
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    @property
    def current(self) -> str:
        return (self.root / "opt" / "plumbline" / "current").resolve().name


@pytest.fixture
def installation(tmp_path: Path, python: Path) -> Installation:
    return Installation(tmp_path / "root", python)


@pytest.fixture
def wanted(tmp_path: Path) -> Path:
    """The configuration of an engineer."""
    path = tmp_path / "crane.toml"
    path.write_text((ROOT / "config" / "adxl355.toml").read_text())
    return path


@pytest.fixture(scope="module")
def installed_root(tmp_path_factory: pytest.TempPathFactory, python: Path) -> Path:
    root = tmp_path_factory.mktemp("installed") / "root"
    assert Installation(root, python).run("install.sh", ROOT / "config" / "adxl355.toml").returncode == 0
    return root


@pytest.fixture
def installed(installation: Installation, installed_root: Path) -> Installation:
    """An installation with the configuration of the engineer: a copy of one that was made once."""
    shutil.copytree(installed_root, installation.root, symlinks=True)
    return installation


def test_scripts_are_valid() -> None:
    scripts = [*(ROOT / "deploy").glob("*.sh"), *(ROOT / "deploy" / "debian").iterdir(), *(ROOT / "script").iterdir()]
    assert len(scripts) > 10
    for script in scripts:
        subprocess.run(["sh", "-n", str(script)], check=True)


def test_installer_names_a_missing_configuration(installation: Installation) -> None:
    done = installation.run("install.sh", "none.toml")
    assert (done.returncode, done.stderr) == (
        2,
        "install.sh: none.toml: no such configuration; config/ has examples\n",
    )
    assert not installation.root.exists()


def test_nothing_is_put_into_service_without_a_configuration(installation: Installation) -> None:
    done = installation.run("install.sh")
    assert done.returncode == 2
    assert "name a configuration" in done.stderr
    assert not installation.root.exists()


@pytest.mark.slow
def test_a_simulated_crane_is_not_put_into_service(installation: Installation, wanted: Path) -> None:
    wanted.write_text("[rope]\nlength_m = 12.0\n")
    done = installation.run("install.sh", wanted)
    assert done.returncode == 2
    assert 'device.kind: "simulated" is no sensor' in done.stderr
    assert "gateway.demonstration = true" in done.stderr
    assert not installation.settings.exists()
    wanted.write_text("[gateway]\ndemonstration = true\n")
    assert installation.run("install.sh", wanted).returncode == 0


@pytest.mark.slow
def test_an_edited_environment_of_the_service_stays(installed: Installation) -> None:
    environment = installed.root / "etc" / "default" / "plumbline"
    environment.write_text("PLUMBLINE_GATEWAY__DATA_DIR=/srv/plumbline\n")
    assert installed.run("install.sh").returncode == 0
    assert environment.read_text() == "PLUMBLINE_GATEWAY__DATA_DIR=/srv/plumbline\n"


@pytest.mark.slow
def test_the_environment_of_a_former_version_goes_where_root_alone_may_change_it(
    installation: Installation, wanted: Path
) -> None:
    former = installation.settings.with_name("service.env")
    former.parent.mkdir(parents=True)
    former.write_text("PLUMBLINE_GATEWAY__DATA_DIR=/srv/plumbline\n")
    assert installation.run("install.sh", wanted).returncode == 0
    environment = installation.root / "etc" / "default" / "plumbline"
    assert environment.read_text() == "PLUMBLINE_GATEWAY__DATA_DIR=/srv/plumbline\n"
    assert former.exists()  # a version before reads it after a rollback
    for path in (environment, former):
        path.unlink()
    former.symlink_to(wanted)
    assert installation.run("install.sh").returncode == 0
    assert environment.read_text() == (ROOT / "deploy" / "service.env").read_text()


def test_reading_recordings_gives_no_right_to_command_or_to_change_settings() -> None:
    unit, functions = UNIT.read_text(), (ROOT / "deploy" / "functions.sh").read_text()
    assert "\nGroup=plumbline\n" in unit  # of the recordings
    assert "\nEnvironmentFile=/etc/default/plumbline\n" in unit  # it can name programs to load
    assert 'chown root:plumbline-settings "$settings"' in functions
    assert 'chgrp -h plumbline-command "$secret"' in functions


@pytest.mark.slow
def test_an_edited_configuration_is_installed_the_second_time(installed: Installation, wanted: Path) -> None:
    before = wanted.read_text()
    wanted.write_text(before + '\n[page]\nlanguage = "de"\n')
    assert installed.run("install.sh", wanted).returncode == 0
    assert installed.settings.read_text() == wanted.read_text()
    (kept,) = installed.settings.parent.glob("plumbline.toml.until-*")
    assert kept.read_text() == before


@pytest.mark.slow
def test_an_upgrade_keeps_and_checks_the_installed_configuration(installed: Installation) -> None:
    first = installed.current
    installed.settings.write_text("[rope]\nlenght_m = 12.0\n")
    done = installed.run("install.sh")
    assert done.returncode == 2
    assert "did you mean length_m" in done.stderr
    assert installed.current == first
    assert [folder.name for folder in installed.releases.iterdir()] == [first]


@pytest.mark.slow
def test_a_failed_download_leaves_the_installed_version(installed: Installation) -> None:
    first = installed.current
    done = installed.run("install.sh", PIP_EXIT="1")
    assert done.returncode == 2
    assert "the installed version is unchanged" in done.stderr
    assert [folder.name for folder in installed.releases.iterdir()] == [first]


@pytest.mark.slow
def test_rollback_returns_to_the_version_before(installed: Installation) -> None:
    assert installed.run("install.sh", "--rollback").returncode == 2
    first = installed.current
    release = installed.releases / first
    earlier = release.rename(release.with_name("0.0.9-20250101T000000"))
    link = installed.root / "opt" / "plumbline" / "current"
    link.unlink()
    link.symlink_to(f"releases/{earlier.name}")
    assert installed.run("install.sh").returncode == 0
    second = installed.current
    for expected in (earlier.name, second):
        assert installed.run("install.sh", "--rollback").returncode == 0
        assert installed.current == expected


@pytest.mark.slow
def test_uninstall_asks_before_it_deletes_recordings(installed: Installation) -> None:
    recording = installed.root / "var" / "lib" / "plumbline" / "one.mcap"
    recording.write_bytes(b"")
    refused = installed.run("uninstall.sh")
    assert refused.returncode == 2
    assert "--keep-data or --delete-data" in refused.stderr
    assert installed.run("uninstall.sh", "--keep-data").returncode == 0
    assert recording.exists()
    assert installed.settings.exists()
    assert not installed.releases.exists()
    assert installed.run("uninstall.sh", "--delete-data").returncode == 0
    assert not recording.exists()
    assert not installed.settings.exists()
