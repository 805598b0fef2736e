"""A bridge as a process of its own, and what consumers that look at the angle alone see of it."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Protocol

from tests.system.bus_query import KEY
from tests.system.conftest import ROOT
from tests.waiting import PATIENCE_S


class PlantClient(Protocol):
    """A naive consumer of one protocol."""

    def angle_deg(self) -> float | None:
        """The angle that it would show now; None: it shows that there is none."""

    def state(self) -> str | None:
        """The word for the state; None: the bridge does not answer."""


class RunningBridge:
    """`plumbline bridge`."""

    def __init__(self, protocol: str, endpoint: str, settings: Path, key: str = KEY) -> None:
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-m", "gateway", "bridge", protocol),
                *("--settings", str(settings), "--gateway", key, "--connect", endpoint),
            ],
            cwd=ROOT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.said = self.process.stdout.readline()
        if not self.said:
            raise AssertionError(self.process.communicate()[1])

    def signal(self, what: signal.Signals) -> None:
        self.process.send_signal(what)

    def stop(self) -> tuple[int, str]:
        """(exit code, standard error)."""
        self.process.send_signal(signal.SIGTERM)
        _, err = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, err

    def end(self) -> None:
        """Kill it, whatever it does."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()
