"""Commands that recover the bus, and the script that clears the one of a Pi."""

import stat
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.daemon.sampling import device_factory
from gateway.daemon.sampling.device_factory import run_hook

SCRIPT = Path(__file__).parents[4] / "deploy" / "i2c-bus-clear"


def test_a_command_that_succeeds_is_a_step() -> None:
    assert run_hook([sys.executable, "-c", "pass"])


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ([sys.executable, "-c", "import sys; sys.exit('no gpio')"], "exit code 1, no gpio"),
        (["/nowhere/clear"], "No such file"),
    ],
)
def test_a_command_that_fails_is_logged(command: list[str], words: str, caplog: pytest.LogCaptureFixture) -> None:
    assert not run_hook(command)
    assert words in caplog.text


def test_a_command_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(device_factory, "HOOK_S", 0.1)
    assert not run_hook([sys.executable, "-c", "import time; time.sleep(60)"])
    assert "timed out" in caplog.text


def test_the_script_gives_nine_pulses_and_a_stop_and_never_drives_a_line_high(tmp_path: Path) -> None:
    """A `pinctrl` that writes down what it is told, in place of the pins."""
    told = tmp_path / "told"
    pinctrl = tmp_path / "pinctrl"
    pinctrl.write_text(f'#!/bin/sh\necho "$@" >> {told}\n')
    pinctrl.chmod(pinctrl.stat().st_mode | stat.S_IXUSR)
    path = f"{tmp_path}:/usr/bin:/bin"
    subprocess.run(["/bin/sh", str(SCRIPT)], check=True, env={"PATH": path})
    low, high = "set 3 op dl", "set 3 ip pu"
    sda_low, sda_high = "set 2 op dl", "set 2 ip pu"
    assert told.read_text().splitlines() == [
        sda_high,
        *[low, high] * 9,
        *[low, sda_low, high, sda_high],  # SDA rises while SCL is high
        "set 2,3 a0 pu",
    ]
