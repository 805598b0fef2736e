"""What the bridges cost and how late they are, and how soon a consumer sees a failure: real processes all of them."""

import asyncio
import os
import signal
import statistics
import tempfile
import threading
import time
from collections.abc import Callable
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from asyncua import ua

from tests.benchmarks.process_use import cpu_s, resident_mib
from tests.gateway.bridge.modbus_client import ModbusClient
from tests.ports import unused_port
from tests.system.bus_query import KEY
from tests.system.conftest import BusPeer, RunningGateway
from tests.system.foxglove_client import FoxgloveClient
from tests.system.mosquitto import Subscriber
from tests.system.plant_clients import ModbusPlant, MqttPlant, OpcuaPlant, OpcuaSite
from tests.system.running_bridge import PlantClient, RunningBridge
from tests.system.test_alert_delivery import CHATTERING
from tests.system.test_bridge_states import Plant
from tests.waiting import wait_until

CLIENTS = 20
MEASURE_S = 20.0
POLL_S = 0.01
RUNS = 3


def main() -> None:
    """Print the figures."""
    print(f"bridges: simulated crane, load {os.getloadavg()[0]:.0f}", flush=True)
    for part in (_costs, _failures):
        with tempfile.TemporaryDirectory() as folder:
            part(Path(folder))


def _late_ms(sample: datetime) -> float:
    return 1e3 * (time.time() - sample.timestamp())


def _costs(folder: Path) -> None:
    gateway = RunningGateway(folder, CHATTERING)
    plant = Plant(folder, gateway.endpoint)
    plant.until_angle()
    gateway_s, begun_s = cpu_s(gateway.process.pid), time.monotonic()
    viewers_port = unused_port()
    settings = folder / "foxglove.toml"
    settings.write_text(f'demonstration = true\n[foxglove]\nlisten = "127.0.0.1:{viewers_port}"\n')
    viewed = RunningBridge("foxglove", gateway.endpoint, settings)
    consumers: dict[str, Callable[[], list[float]]] = {
        "modbus": partial(_modbus, plant),
        "mqtt": partial(_mqtt, plant),
        "opcua": partial(_opcua, plant),
        "foxglove": partial(_foxglove, viewers_port),
    }
    for clients in (0, CLIENTS):
        for name, bridge in (*plant.bridges.items(), ("foxglove", viewed)):
            before_s, start_s = cpu_s(bridge.process.pid), time.monotonic()
            late_ms = consumers[name]() if clients else _rest()
            cpu_percent = 100 * (cpu_s(bridge.process.pid) - before_s) / (time.monotonic() - start_s)
            print(
                f"  {name:<7} {clients:2} clients: {cpu_percent:5.1f} % of a core, {resident_mib(bridge.process.pid):4.0f} MiB"
                + (f", sample to client {_quantiles(late_ms)} ms" if late_ms else ""),
                flush=True,
            )
    daemon_percent = 100 * (cpu_s(gateway.process.pid) - gateway_s) / (time.monotonic() - begun_s)
    print(f"  the gateway itself, meanwhile: {daemon_percent:.1f} % of a core", flush=True)
    peer = BusPeer(gateway.endpoint)
    time.sleep(MEASURE_S / 2)
    bus_ms = [
        (at_ns - time_ns) / 1e6
        for (at_ns, key, _), time_ns in zip(
            [each for each in peer.heard if each[1].endswith("/motion")],
            [message["time_ns"] for message in peer.messages("motion")],
            strict=False,
        )
    ]
    print(f"  without a bridge, on the bus: sample to client {_quantiles(bus_ms)} ms", flush=True)
    peer.close()
    viewed.end()
    plant.end()
    gateway.stop()


def _rest() -> list[float]:
    time.sleep(MEASURE_S)
    return []


def _quantiles(values: list[float]) -> str:
    ordered = sorted(values)
    return f"p50 {statistics.median(ordered):.0f}, p99 {ordered[int(0.99 * (len(ordered) - 1))]:.0f} (n {len(ordered)})"


def _modbus(plant: Plant) -> list[float]:
    """Poll 20 times at 10 Hz, and one of them as fast as it goes, whose counter is compared with the bus."""
    server = plant.clients["modbus"]
    assert isinstance(server, ModbusPlant)
    port = server.port
    ending = threading.Event()

    def poll() -> None:
        with ModbusClient(port) as client:
            while not ending.wait(0.1):
                client.read()

    pollers = [threading.Thread(target=poll) for _ in range(CLIENTS - 1)]
    for each in pollers:
        each.start()
    peer, late_ms, last = BusPeer(plant.endpoint, f"{KEY}/motion"), [], -1
    with ModbusClient(port) as client:
        end_s = time.monotonic() + MEASURE_S
        while time.monotonic() < end_s:
            counter = client.read(2, 1)[0]
            if counter != last and peer.heard:
                late_ms.append((time.time_ns() - peer.messages("motion")[-1]["time_ns"]) / 1e6)
                peer.heard.clear()
            last = counter
            time.sleep(POLL_S)
    ending.set()
    for each in pollers:
        each.join()
    peer.close()
    return late_ms[1:]


def _mqtt(plant: Plant) -> list[float]:
    client = plant.clients["mqtt"]
    assert isinstance(client, MqttPlant)
    subscribers = [Subscriber(client.broker.port, "plumbline/#") for _ in range(CLIENTS)]
    late_ms: list[float] = []
    last, end_s = None, time.monotonic() + MEASURE_S
    while time.monotonic() < end_s:
        state = subscribers[0].last("/state")
        if state is not None and state["sample_utc"] not in (None, last):
            last = state["sample_utc"]
            late_ms.append(_late_ms(datetime.fromisoformat(last)))
        time.sleep(POLL_S)
    for each in subscribers:
        each.close()
    return late_ms[1:]


class _Late:
    """How late the changes of a subscription are."""

    def __init__(self) -> None:
        self.late_ms: list[float] = []

    def datachange_notification(self, _node: object, _value: object, data: Any) -> None:
        sample = data.monitored_item.Value.SourceTimestamp
        if sample is not None:
            self.late_ms.append(_late_ms(sample))


def _opcua(plant: Plant) -> list[float]:
    client = plant.clients["opcua"]
    assert isinstance(client, OpcuaPlant)
    return asyncio.run(_subscribe(client.site))


async def _subscribe(site: OpcuaSite) -> list[float]:
    late = _Late()
    clients = [await site.connect(timeout_s=30) for _ in range(CLIENTS)]
    index = await clients[0].get_namespace_index("urn:plumbline:bridge")
    for number, client in enumerate(clients):
        subscription = await client.create_subscription(100, late if number == 0 else _Late())
        node = client.get_node(ua.NodeId(f"{KEY.removeprefix('plumbline/v1/')}/angle_deg", index))
        await subscription.subscribe_data_change(node)
    await asyncio.sleep(MEASURE_S)
    for client in clients:
        await client.disconnect()
    return late.late_ms[1:]


def _foxglove(port: int) -> list[float]:
    """Show `/motion` to 20 viewers; one of them says how late it is."""
    viewers = [FoxgloveClient(port).subscribe("/motion", "/bridge") for _ in range(CLIENTS)]
    end_s = time.monotonic() + MEASURE_S
    others = [threading.Thread(target=_view, args=(viewer, end_s)) for viewer in viewers[1:]]
    for each in others:
        each.start()
    late_ms: list[float] = []
    _view(
        viewers[0],
        end_s,
        lambda: late_ms.append((time.time_ns() - viewers[0].messages["/motion"][-1]["time_ns"]) / 1e6),
    )
    for each in others:
        each.join()
    for viewer in viewers:
        viewer.close()
    return late_ms[1:]


def _view(viewer: FoxgloveClient, end_s: float, act: Callable[[], object] = lambda: None) -> None:
    """Read what comes until a time; act on each message of the motion."""
    while time.monotonic() < end_s:
        n_seen = len(viewer.messages.get("/motion", ()))
        viewer.until(partial(_has_more, viewer, n_seen))
        act()


def _has_more(viewer: FoxgloveClient, n_seen: int) -> bool:
    return len(viewer.messages.get("/motion", ())) > n_seen


def _failures(folder: Path) -> None:
    """Print how soon a consumer that looks at the angle alone sees that there is none."""
    gateway = RunningGateway(folder, CHATTERING)
    environment = {"PLUMBLINE_BUS__LISTEN": f'["{gateway.endpoint}"]'}
    plant = Plant(folder, gateway.endpoint)
    for name, client in plant.clients.items():
        found: dict[str, list[float]] = {
            "gateway held": [],
            "bridge held": [],
            "gateway killed": [],
            "bridge killed": [],
        }
        for _ in range(RUNS):
            for what, process in (("gateway held", gateway.process), ("bridge held", plant.bridges[name].process)):
                plant.until_angle()
                found[what].append(_time_to_nothing(client, partial(process.send_signal, signal.SIGSTOP)))
                process.send_signal(signal.SIGCONT)
            plant.until_angle()
            found["gateway killed"].append(_time_to_nothing(client, gateway.process.kill))
            gateway.wait()
            gateway = RunningGateway(folder, CHATTERING, environment=environment)
            plant.until_angle()
            found["bridge killed"].append(_time_to_nothing(client, plant.bridges[name].process.kill))
            plant.bridges[name].end()
            plant.bridges[name] = plant.start(name)
        said = ", ".join(f"{what} {statistics.median(times):.2f} ({max(times):.2f})" for what, times in found.items())
        print(f"  no angle at a consumer of {name}, s after: {said}", flush=True)
    plant.end()
    gateway.stop()


def _time_to_nothing(client: PlantClient, act: Callable[[], object]) -> float:
    begin_s = time.monotonic()
    act()
    wait_until(lambda: client.angle_deg() is None, "no angle")
    return time.monotonic() - begin_s
