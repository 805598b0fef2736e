"""A bridge that hangs, under a service manager that does what its unit says: consumers see within 2 s that it is gone."""

import re
import signal
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.system.conftest import ROOT, StartGateway
from tests.system.plant_clients import MqttPlant
from tests.system.running_bridge import RunningBridge
from tests.system.test_alert_delivery import CHATTERING
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

UNIT = (ROOT / "deploy" / "plumbline-bridge@.service").read_text()
SEEN_S = 2.0


class Manager:
    """What systemd does for a service with `Type=notify` and a watchdog: it waits for signs of life, and ends who gives none."""

    def __init__(self, folder: Path) -> None:
        (patience_ms,) = re.findall(r"^WatchdogSec=(\d+)ms$", UNIT, re.M)
        (name,) = re.findall(r"^WatchdogSignal=(SIG\w+)$", UNIT, re.M)
        assert "\nType=notify\n" in UNIT
        self._signal = signal.Signals[name]
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(folder / "notify"))
        self._socket.settimeout(int(patience_ms) / 1e3)
        self.environment = {"NOTIFY_SOCKET": str(folder / "notify")}
        self.has_ended_it = False

    def watch(self, end: Callable[[signal.Signals], None]) -> None:
        """Watch in a thread from the word that the service is ready."""
        while self._socket.recv(100) != b"READY=1":
            continue
        self._watcher = threading.Thread(target=self._watch, args=(end,))
        self._watcher.start()

    def close(self) -> None:
        """Watch until nobody gives signs of life any more."""
        self._watcher.join()
        self._socket.close()

    def _watch(self, end: Callable[[signal.Signals], None]) -> None:
        try:
            while True:
                assert self._socket.recv(100) == b"WATCHDOG=1"
        except TimeoutError:
            self.has_ended_it = True
            end(self._signal)  # nothing, where it has ended


def test_consumers_of_a_bridge_that_hangs_see_within_two_seconds_that_it_is_gone(
    start_gateway: StartGateway, tmp_path: Path
) -> None:
    gateway, plant, manager = start_gateway(CHATTERING), MqttPlant(tmp_path), Manager(tmp_path)
    settings = tmp_path / "bridge.toml"
    settings.write_text("demonstration = true\n" + plant.settings)
    bridge = RunningBridge("mqtt", gateway.endpoint, settings, environment=manager.environment)
    try:
        manager.watch(bridge.signal)
        wait_until(lambda: plant.angle_deg() is not None, "an angle")
        time.sleep(SEEN_S)
        assert not manager.has_ended_it
        bridge.signal(signal.SIGSTOP)
        held_s = time.monotonic()
        wait_until(lambda: plant.angle_deg() is None, "no angle")
        assert time.monotonic() - held_s < SEEN_S
        assert plant.state() == "bridge gone"
    finally:
        bridge.end()
        manager.close()
        plant.close()
