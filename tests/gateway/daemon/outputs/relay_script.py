"""A relay at the outermost wire: a program that writes down each call, and a GPIO chip that writes down each level."""

import sys
from pathlib import Path

SCRIPT = """#!/bin/sh
set -eu
if [ -e {folder}/hang ]; then sleep 30; fi
if [ -e {folder}/fail ]; then exit 3; fi
echo "$1" >> {folder}/calls
"""

CHIP = """
import gpiod, os

class Request:
    def __init__(self, config):
        (self.line, self.settings), = config.items()
        self._write(self.settings.output_value)
    def _write(self, value):
        level = (value is gpiod.line.Value.ACTIVE) != self.settings.active_low
        with open({levels!r}, "a") as file:
            file.write("high\\n" if level else "low\\n")
    def set_value(self, line, value):
        assert line == self.line
        if os.path.exists({broken!r}):
            raise OSError(5, "Input/output error")
        self._write(value)
    def release(self):
        with open({levels!r}, "a") as file:
            file.write("returned\\n")

def request_lines(path, consumer=None, config=None):
    if path != "/dev/gpiochip0":
        raise FileNotFoundError(2, "No such file or directory")
    assert consumer == "plumbline-relay"
    assert all(isinstance(each, gpiod.LineSettings) for each in config.values())
    assert all(each.direction is gpiod.line.Direction.OUTPUT for each in config.values())
    return Request(config)

gpiod.request_lines = request_lines
"""


class ScriptedRelay:
    """A command that notes how it was called."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = folder / "relay"
        self.path.write_text(SCRIPT.format(folder=folder))
        self.path.chmod(0o755)

    @property
    def calls(self) -> list[str]:
        """What it was told, in order."""
        file = self._folder / "calls"
        return file.read_text().split() if file.exists() else []

    @property
    def state(self) -> str:
        """The last word."""
        return self.calls[-1] if self.calls else ""

    def break_by(self, name: str) -> None:
        """Let every call `hang` or `fail` from now on."""
        (self._folder / name).touch()

    def mend(self, name: str) -> None:
        """Let calls succeed again."""
        (self._folder / name).unlink()


class FakeGpioChip:
    """`/dev/gpiochip0` at the boundary of the library: all of `gpiod` is real but the call that opens the chip."""

    def __init__(self, folder: Path) -> None:
        self._levels, self._broken = folder / "levels", folder / "broken"
        self.site = folder / "site"
        self.site.mkdir()
        (self.site / "sitecustomize.py").write_text(CHIP.format(levels=str(self._levels), broken=str(self._broken)))

    @property
    def path(self) -> str:
        """PYTHONPATH of a process that finds this chip."""
        return ":".join([str(self.site), *filter(None, sys.path)])

    @property
    def levels(self) -> list[str]:
        """The electrical levels of the line, in order."""
        return self._levels.read_text().split() if self._levels.exists() else []

    def break_line(self) -> None:
        """Let every later call fail."""
        self._broken.touch()
