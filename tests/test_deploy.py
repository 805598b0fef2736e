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
MOST_EXPOSURE = 2.5

Completed = subprocess.CompletedProcess[str]


@pytest.fixture
def analyze() -> Callable[..., Completed]:
    """`systemd-analyze`, which CI has."""
    program = shutil.which("systemd-analyze")
    if program is None:
        assert "CI" not in os.environ, "CI installs systemd-analyze"
        pytest.skip("systemd-analyze is not on this machine")

    def run(*arguments: str | Path) -> Completed:
        return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)

    return run


def test_systemd_accepts_the_unit(analyze: Callable[..., Completed], tmp_path: Path) -> None:
    unit = tmp_path / "plumbline.service"
    # The program is not installed here: any executable stands in for it.
    unit.write_text(UNIT.read_text().replace("/opt/plumbline/.venv/bin/plumbline", sys.executable))
    done = analyze("verify", "--man=no", unit)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_sandbox_is_tight(analyze: Callable[..., Completed]) -> None:
    done = analyze("security", "--offline=true", UNIT)
    exposure = re.search(r"exposure level for plumbline.service: ([\d.]+)", done.stdout)
    assert exposure is not None, done.stdout + done.stderr
    assert float(exposure[1]) <= MOST_EXPOSURE


def test_the_watchdog_is_fed_often_enough() -> None:
    """A read takes at most half a second, a pause before reopening at most five."""
    text = UNIT.read_text()
    assert "Type=notify" in text
    seconds = re.search(r"^WatchdogSec=(\d+)$", text, re.MULTILINE)
    assert seconds is not None
    assert int(seconds[1]) >= 10


def test_installer_is_a_valid_script_and_names_a_missing_configuration(tmp_path: Path) -> None:
    script = ROOT / "deploy" / "install.sh"
    subprocess.run(["sh", "-n", str(script)], check=True)
    environment = {**os.environ, "PLUMBLINE_ROOT": str(tmp_path)}
    done = subprocess.run(
        ["sh", str(script), "none.toml"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr == "install.sh: none.toml: no such configuration; config/ has examples\n"
    assert list(tmp_path.iterdir()) == []
