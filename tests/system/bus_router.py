"""A Zenoh router in a process of its own, so that the link and the gateway can fail apart from each other."""

import signal
import subprocess
import sys
from pathlib import Path

from tests.ports import unused_port

PROGRAM = Path(__file__).parents[1] / "alert_campaign" / "router.py"


class BusRouter:
    """A router on a port of its own, which keeps it over a restart."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/127.0.0.1:{unused_port()}"
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen([sys.executable, str(PROGRAM), self.endpoint])

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def signal(self, what: signal.Signals) -> None:
        self._process.send_signal(what)
