"""`plumbline setup` on a real pseudo-terminal, with a chip at the place of `smbus2.SMBus`, and from a file."""

import os
import pty
import re
import select
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from tests.system.conftest import ROOT, Plumbline
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

ANSWERS = """\
[gateway]
crane = "north"
[device]
kind = "adxl355"
[rope]
length_m = 18.5
[housing]
above_load_m = 2.0
"""


@pytest.fixture
def dev(tmp_path: Path) -> Path:
    """The folder of devices of a machine with one I2C bus."""
    dev = tmp_path / "dev"
    dev.mkdir()
    (dev / "i2c-1").touch()
    return dev


class Terminal:
    """A person at a pseudo-terminal who waits for each question."""

    def __init__(self, dev: Path, *arguments: str | Path) -> None:
        self._master, slave = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.system.setup_on_chips", str(dev), "setup", *map(str, arguments)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdin=slave,
            stdout=slave,
            stderr=slave,
            close_fds=True,
        )
        os.close(slave)
        self.text = ""
        self._read_to = 0

    def expect(self, pattern: str) -> None:
        """Read until the output since the last match contains a pattern."""
        end_s = time.monotonic() + PATIENCE_S
        while (match := re.search(pattern, self.text[self._read_to :])) is None:
            assert time.monotonic() < end_s, f"{pattern!r} did not come in {self.text!r}"
            if select.select([self._master], [], [], 0.2)[0]:
                try:
                    self.text += os.read(self._master, 65536).decode(errors="replace")
                except OSError:  # the other end is closed
                    assert re.search(pattern, self.text[self._read_to :]), f"{pattern!r} did not come in {self.text!r}"
        self._read_to += match.end()

    def answer(self, question: str, text: str = "") -> None:
        self.expect(re.escape(question))
        os.write(self._master, f"{text}\n".encode())

    def wait(self) -> int:
        return self.process.wait(PATIENCE_S)


def test_a_person_sets_up_a_gateway_on_a_terminal(dev: Path, tmp_path: Path) -> None:
    out, certificates = tmp_path / "crane.toml", tmp_path / "crane-7"
    certificates.mkdir()
    for name in ("ca.pem", "certificate.pem", "key.pem"):
        (certificates / name).touch()
    person = Terminal(dev, "--out", out)
    person.expect("1  ADXL355 at 0x1d on I2C bus 1")
    person.answer("Which one is in the housing? [1]:", "7")
    person.expect("1 to 2, not 7")
    person.answer("Which one is in the housing? [1]:")
    person.answer("Label on the housing", "H-0042")
    person.answer("z points up the rope [x,y,z]:", "x,y,-z")
    person.expect("left-handed")
    person.answer("z points up the rope [x,y,z]:")
    person.answer("Site [yard]:", "harbour")
    person.answer("Crane [crane-1]:", "crane 7")
    person.expect("should be letters, digits, '.', '_' and '-'")
    person.answer("Crane [crane-1]:", "crane-7")
    person.answer("Sensor [hook-1]:")
    person.answer("Length from the pivot to the load's centre, m:")
    person.expect("needs an answer")
    person.answer("Length from the pivot to the load's centre, m:", "21,5")
    person.answer("Distance of the housing above the load's centre, m:", "80")
    person.expect("is more than rope.length_m")
    person.answer("Distance of the housing above the load's centre, m:", "2.5")
    person.answer("What carries the housing", "a hook")
    person.answer("What carries the housing", "none")
    person.answer("Latitude of the site", "52.2")
    person.answer("Trip level, degrees [6]:", "5")
    person.answer("Warning level, degrees [3.33]:", "9")
    person.expect("must hold")
    person.answer("Warning level, degrees [3.33]:", "3")
    person.answer("Alerts clear below, degrees [1.67]:")
    person.answer("by a side pull, degrees [3]:")
    person.answer("Address and port [127.0.0.1:8321]:")
    person.answer("Language, en or de [en]:", "de")
    person.answer("Folder with the gateway's certificates [none]:", str(dev))
    person.expect("ca.pem: no such file")
    person.answer("Folder with the gateway's certificates [none]:", str(certificates))
    assert not out.exists()
    person.answer(f"Write this to {out}? [Y/n]")
    person.expect(r"adxl355-01-i2c1-1d|H-0042")
    person.expect(r"the housing's \+z face is up")
    person.expect("next: plumbline run")
    assert person.wait() == 0
    table = tomllib.loads(out.read_text())
    assert table["gateway"] == {"site": "harbour", "crane": "crane-7", "sensor": "hook-1"}
    assert table["device"] == {"kind": "adxl355", "bus": 1, "address": 0x1D, "serial": "H-0042", "axes_map": "x,y,z"}
    assert table["rope"] == {"length_m": 21.5}
    assert table["alerts"] == {"trip_deg": 5.0, "warn_deg": 3.0, "clear_deg": 1.67, "lean_trip_deg": 3.0}
    assert table["bus"]["listen"] == ["tls/0.0.0.0:7447", "tcp/127.0.0.1:7447"]
    assert table["bus"]["tls"]["key"] == str(certificates / "key.pem")
    assert "# pivot to the load's centre" in out.read_text()


def test_a_person_may_stop_at_any_question(dev: Path, tmp_path: Path) -> None:
    out = tmp_path / "crane.toml"
    person = Terminal(dev, "--out", out)
    person.answer("Which one is in the housing? [1]:", "\x04")
    person.expect("the answers have ended; nothing was written")
    assert person.wait() == 2
    assert not out.exists()


def test_an_existing_configuration_is_replaced_only_when_told(dev: Path, tmp_path: Path) -> None:
    out = tmp_path / "crane.toml"
    out.write_text("[rope]\nlength_m = 9.0\n")
    person = Terminal(dev, "--out", out)
    person.answer("exists. Replace it? The former one is kept beside it. [y/N]")
    person.expect("--replace replaces it")
    assert person.wait() == 2
    assert out.read_text() == "[rope]\nlength_m = 9.0\n"


def test_answers_from_a_file_need_no_terminal(plumbline: Plumbline, tmp_path: Path) -> None:
    answers, out = tmp_path / "answers.toml", tmp_path / "crane.toml"
    answers.write_text(ANSWERS)
    done = plumbline("setup", "--from", answers, "--out", out, "--no-check")
    assert (done.returncode, done.stdout) == (0, f"{out}: written\n")
    assert tomllib.loads(out.read_text()) == tomllib.loads(ANSWERS)
    refused = plumbline("setup", "--from", answers, "--out", out, "--no-check")
    assert refused.returncode == 2
    assert "--replace" in refused.stderr
    answers.write_text(ANSWERS.replace("18.5", "19.5"))
    assert plumbline("setup", "--from", answers, "--out", out, "--no-check", "--replace").returncode == 0
    (kept,) = tmp_path.glob("crane.toml.until-*")
    assert tomllib.loads(kept.read_text()) == tomllib.loads(ANSWERS)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("length_m = 18.5", ""), "rope.length_m: is missing"),
        (("above_load_m = 2.0", ""), "housing.above_load_m: is missing"),
        (("adxl355", "simulated"), 'device.kind: "simulated" is no sensor'),
        (("above_load_m", "above_laod_m"), "did you mean above_load_m"),
        (("[rope]", "[rope"), "is not TOML"),
    ],
)
def test_a_file_of_answers_with_an_error_writes_nothing(
    change: tuple[str, str], why: str, plumbline: Plumbline, tmp_path: Path
) -> None:
    answers, out = tmp_path / "answers.toml", tmp_path / "crane.toml"
    answers.write_text(ANSWERS.replace(*change))
    done = plumbline("setup", "--from", answers, "--out", out)
    assert done.returncode == 2
    assert why in done.stderr
    assert done.stderr.count("\n") == 1
    assert not out.exists()
