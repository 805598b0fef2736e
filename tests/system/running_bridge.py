"""A bridge as a process of its own, and what consumers that look at the angle alone see of it."""

import itertools
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from tests.system.bus_query import KEY
from tests.system.conftest import ROOT
from tests.system.forked_program import ForkedProgram
from tests.waiting import PATIENCE_S

NUMBERS = itertools.count()
ALLOCATOR = dict(re.findall(r"(MALLOC_\w+)=(\d+)", (ROOT / "deploy" / "plumbline-bridge@.service").read_text()))
"""How the service has the memory kept."""


class PlantClient(Protocol):
    """A naive consumer of one protocol."""

    settings: str
    """The section of its bridge."""

    def angle_deg(self) -> float | None:
        """The angle that it would show now; None: it shows that there is none."""

    def state(self) -> str | None:
        """The word for the state; None: the bridge does not answer."""

    def close(self) -> None:
        """End it."""


class RunningBridge:
    """`plumbline bridge`; a program of its own, as a service has it, where it is given an environment."""

    def __init__(
        self, protocol: str, endpoint: str, settings: Path, key: str = KEY, environment: Mapping[str, str] | None = None
    ) -> None:
        self._log = settings.with_name(f"bridge-{next(NUMBERS)}.log")
        words = ["gateway", "bridge", protocol, "--settings", str(settings), "--gateway", key, "--connect", endpoint]
        self.process: ForkedProgram | subprocess.Popen[str]
        with self._log.open("w") as log:
            if environment is None:
                self.process = ForkedProgram(words, ROOT, os.environ, subprocess.PIPE, log.fileno())
            else:
                command = [sys.executable, "-m", *words]
                env = {**os.environ, "PYTHONUNBUFFERED": "1", **ALLOCATOR, **environment}
                self.process = subprocess.Popen(
                    command, cwd=ROOT, env=env, stdout=subprocess.PIPE, stderr=log, text=True
                )
        assert self.process.stdout is not None
        self.said = self.process.stdout.readline()
        if not self.said:
            raise AssertionError(f"{self.process.wait()}: {self._said()}")

    def signal(self, what: signal.Signals) -> None:
        self.process.send_signal(what)

    def says(self, text: str) -> bool:
        """Whether its log has a text."""
        return text in self._said()

    def _said(self) -> str:
        return self._log.read_text()

    def stop(self) -> tuple[int, str]:
        """(exit code, standard error)."""
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate(timeout=PATIENCE_S)
        return self.process.wait(), self._said()

    def end(self) -> None:
        """Kill it, whatever it does."""
        if self.process.stdout is not None and not self.process.stdout.closed:
            self.process.kill()
            self.process.communicate()
