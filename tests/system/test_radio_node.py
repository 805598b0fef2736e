"""A radio node through the whole gateway, as a process, from a pseudo-terminal to the bus."""

import json
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.devices.serial.node_wire import Node
from tests.devices.serial.serial_peer import Peer
from tests.system.conftest import JoinBus, Plumbline, StartGateway

pytestmark = pytest.mark.slow


class Housing:
    """A node in a housing that leans, with its receiver."""

    def __init__(self, port: Path, number: int = 7) -> None:
        self.peer = Peer(port)
        self.battery_v = 3.7
        self._node = Node(node=number)
        self._stopping = threading.Event()
        self._sender = threading.Thread(target=self._run)
        self._sender.start()

    def _run(self) -> None:
        counts = np.tile([1428, 0, 16322], (5, 1)).astype(np.int16)  # 5 degrees
        due_s = time.monotonic()
        while not self._stopping.is_set():
            low = self.battery_v < 3.4
            self.peer.send(self._node.frame(counts=counts, battery_v=self.battery_v, battery_low=low))
            due_s += 0.05
            time.sleep(max(0.0, due_s - time.monotonic()))

    def stop(self) -> None:
        self._stopping.set()
        self._sender.join()
        self.peer.unplug()


@pytest.fixture
def housing(tmp_path: Path) -> Iterator[Housing]:
    housing = Housing(tmp_path / "receiver")
    yield housing
    housing.stop()


def configuration(housing: Housing, number: int = 7) -> str:
    return f'[device]\nkind = "node"\nport = "{housing.peer.name}"\nnode = {number}\n[housing]\nposition_m = 5\n'


def test_battery_and_signal_of_a_node_are_in_its_gateway_s_health(
    start_gateway: StartGateway, join_bus: JoinBus, housing: Housing
) -> None:
    gateway = start_gateway(configuration(housing))
    peer = join_bus(gateway.endpoint)
    tilt = peer.wait_for("tilt", lambda message: abs(message["axial_deg"] - 5.0) < 0.1)
    assert tilt["temperature_c"] == 21.5
    health = peer.wait_for("health", lambda message: message["battery_v"] is not None)
    assert (health["battery_v"], health["battery_percent"], health["signal_dbm"]) == (3.7, None, -67.0)
    assert (health["battery_low"], health["device_id"], health["device_kind"]) == (False, "node-7", "node")
    housing.battery_v = 3.3
    assert peer.wait_for("health", lambda message: message["battery_low"])["battery_v"] == 3.3
    assert health["lost"] == 0


def test_doctor_names_the_battery_and_the_nodes_that_are_heard(
    plumbline: Plumbline, housing: Housing, tmp_path: Path
) -> None:
    config = tmp_path / "node.toml"
    data = f"[gateway]\ndata_dir = {json.dumps(str(tmp_path / 'data'))}\n"
    config.write_text(data + configuration(housing))
    done = plumbline("doctor", "--device", "--config", config)
    assert "battery 3.70 V, signal -67 dBm" in done.stdout, done.stdout + done.stderr
    assert re.search(r"ok   reading      node-7: \d+(\.\d+)? samples/s, nominal 100, 21.5 °C", done.stdout)
    config.write_text(data + configuration(housing, 8))
    done = plumbline("doctor", "--device", "--config", config)
    assert done.returncode == 1
    assert "node 8 is not heard; heard are 7 (" in done.stdout
