"""What consumers in a plant see when sensor, gateway, link or bridge fail: real processes, a bridge of each protocol."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest

from gateway.bridge.plant_snapshot import PlantState
from tests.system.conftest import ROOT, Plumbline, RunningGateway, StartGateway
from tests.system.plant_clients import ModbusPlant, MqttPlant, OpcuaPlant
from tests.system.running_bridge import PlantClient, RunningBridge
from tests.system.test_alert_delivery import CHATTERING, Radio
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

STALE_S = 4
PlantKind = type[ModbusPlant] | type[MqttPlant] | type[OpcuaPlant]
PLANTS: tuple[PlantKind, ...] = (ModbusPlant, MqttPlant, OpcuaPlant)


class Plant:
    """Consumers of every protocol, and the bridges between them and a gateway."""

    def __init__(
        self, folder: Path, endpoint: str, *, demonstration: bool = True, kinds: Sequence[PlantKind] = PLANTS
    ) -> None:
        self._settings, self.endpoint = folder / "bridge.toml", endpoint
        self.clients = {kind.protocol: kind(folder) for kind in kinds}
        head = "demonstration = true\n" if demonstration else ""
        self._settings.write_text(head + "".join(client.settings for client in self.clients.values()))
        self.bridges = {name: self.start(name) for name in self.clients}

    def start(self, protocol: str) -> RunningBridge:
        return RunningBridge(protocol, self.endpoint, self._settings)

    def _until(self, condition: Callable[[PlantClient], object], what: str) -> None:
        for name, client in self.clients.items():
            wait_until(partial(condition, client), f"{what} by {name}")

    def until_angle(self) -> None:
        self._until(lambda client: client.angle_deg() is not None, "an angle")

    def until_nothing(self) -> None:
        self._until(lambda client: client.angle_deg() is None, "no angle")

    def until_state(self, *states: PlantState | None) -> None:
        """Wait until every consumer sees one of these states, and no angle unless it is fine."""
        self._until(lambda client: client.state() in states, " or ".join(map(str, states)))
        if PlantState.FINE not in states:
            assert [client.angle_deg() for client in self.clients.values()] == [None] * len(self.clients)

    def ages_s(self) -> list[float]:
        """By Modbus and MQTT."""
        modbus, mqtt = self.clients["modbus"], self.clients["mqtt"]
        assert isinstance(modbus, ModbusPlant)
        assert isinstance(mqtt, MqttPlant)
        return [modbus.age_s(), mqtt.age_s()]

    def end(self) -> None:
        for bridge in self.bridges.values():
            bridge.end()
        for client in self.clients.values():
            client.close()


JoinPlant = Callable[..., Plant]


@pytest.fixture
def join_plant(tmp_path: Path) -> Iterator[JoinPlant]:
    """Joins a plant to a gateway, and takes it away after the test."""
    plants: list[Plant] = []

    def join(gateway: RunningGateway, *, demonstration: bool = True, kinds: Sequence[PlantKind] = PLANTS) -> Plant:
        plants.append(Plant(tmp_path, gateway.endpoint, demonstration=demonstration, kinds=kinds))
        return plants[-1]

    yield join
    for plant in plants:
        plant.end()


GONE = (PlantState.GATEWAY_GONE, PlantState.LINK_GONE)


def test_a_gateway_that_is_recalibrated_hangs_or_is_killed_or_bridges_that_do_leave_no_angle(
    start_gateway: StartGateway, join_plant: JoinPlant, plumbline: Plumbline
) -> None:
    gateway = start_gateway(CHATTERING)
    plant = join_plant(gateway)
    plant.until_angle()
    link = ("--by", "ann", "--connect", gateway.endpoint, "--credentials", str(gateway.data_dir))
    command = [sys.executable, "-m", "gateway", "remote", "recalibrate", "--housing-off-rope", *link]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as session:
        plant.until_state(PlantState.SUSPENDED)
        session.kill()
    assert plumbline("remote", "cancel", *link).returncode == 0
    plant.until_angle()
    gateway.process.send_signal(signal.SIGSTOP)
    plant.until_state(*GONE)
    gateway.process.send_signal(signal.SIGCONT)
    plant.until_angle()
    for bridge in plant.bridges.values():
        bridge.signal(signal.SIGSTOP)
    plant.until_nothing()
    for bridge in plant.bridges.values():
        bridge.signal(signal.SIGCONT)
    plant.until_angle()
    gateway.stop(signal.SIGKILL)
    plant.until_state(*GONE)
    for name, bridge in plant.bridges.items():
        bridge.end()
        plant.bridges[name] = plant.start(name)  # its gateway is not there
    plant.until_state(*GONE)
    again = start_gateway(CHATTERING, environment={"PLUMBLINE_BUS__LISTEN": f'["{gateway.endpoint}"]'})
    plant.until_angle()
    for bridge in plant.bridges.values():
        bridge.end()
    plant.until_nothing()
    assert again.stop()[0] == 0


def test_without_calibration_or_samples_there_is_no_angle(start_gateway: StartGateway, join_plant: JoinPlant) -> None:
    radio = Radio()
    toml = f'[device]\nkind = "witmotion"\nport = "{radio.port}"\n[rope]\nlength_m = 6\n[housing]\nposition_m = 4\n'
    plant = join_plant(start_gateway(f"{toml}[alerts]\nstale_s = {STALE_S}\n"), demonstration=False)
    plant.until_state(PlantState.UNCALIBRATED)
    radio.talks.clear()
    plant.until_state(PlantState.STALE)  # the gateway is well, and its alerts are silent as long as nothing is stale
    plant.until_state(PlantState.SENSOR_GONE)
    assert (
        min(plant.ages_s()) > STALE_S - 1
    )  # of the last sample, though the gateway says twice a second that it knows nothing
    radio.talks.set()
    plant.until_state(PlantState.UNCALIBRATED)
    radio.close()


def test_a_simulated_crane_has_no_angle_unless_it_is_asked_for(
    start_gateway: StartGateway, join_plant: JoinPlant
) -> None:
    plant = join_plant(start_gateway(CHATTERING), demonstration=False, kinds=(ModbusPlant, MqttPlant))
    plant.until_state(PlantState.SIMULATED)
    for bridge in plant.bridges.values():
        code, err = bridge.stop()
        assert (code, "Traceback" in err) == (0, False)
