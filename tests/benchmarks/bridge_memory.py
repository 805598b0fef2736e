"""What each link that is opened anew leaves in the memory of the bridges, by hundreds of quick cuts; real processes all of them.

script/bench bridge_memory [--minutes N] [--arenas N]: beside them a bare session of the bus; `--arenas`: areas that the allocator
of the C library may open (0: as many as it likes), by default as the unit file says.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.process_use import describe_slope, resident_mib
from tests.ports import unused_port
from tests.system.conftest import ROOT, BusPeer, RunningGateway
from tests.system.cut_line import Line
from tests.system.plant_clients import ModbusPlant, MqttPlant, OpcuaPlant
from tests.system.running_bridge import ALLOCATOR, PlantClient, RunningBridge
from tests.system.test_alert_delivery import CHATTERING
from tests.waiting import wait_until

CUT_S, PAUSE_S = 0.3, 0.3
LOOK_EVERY = 5
"""Links between two looks."""
BARE = """
import sys, time
from gateway.bus.session import open_session
session = open_session("client", [sys.argv[1]], [])
while True:
    time.sleep(1)
"""


def main(options: Sequence[str] = ()) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--arenas", type=int, default=int(ALLOCATOR["MALLOC_ARENA_MAX"]))
    chosen = parser.parse_args(options)
    print(f"bridge_memory: {chosen.arenas} arenas, load {os.getloadavg()[0]:.0f}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        _cut_for(60 * chosen.minutes, chosen.arenas, Path(folder))


def _cut_for(duration_s: float, arenas: int, folder: Path) -> None:
    gateway = RunningGateway(folder, CHATTERING)
    BusPeer(gateway.endpoint).close()  # it is there
    line = Line(gateway.endpoint)
    clients: dict[str, PlantClient] = {kind.protocol: kind(folder) for kind in (ModbusPlant, MqttPlant, OpcuaPlant)}
    settings = folder / "bridge.toml"
    settings.write_text(
        "demonstration = true\n"
        + "".join(client.settings for client in clients.values())
        + f'[foxglove]\nlisten = "127.0.0.1:{unused_port()}"\n'
    )
    environment = {"MALLOC_ARENA_MAX": str(arenas)}
    names = (*clients, "foxglove")
    bridges = {name: RunningBridge(name, line.endpoint, settings, environment=environment) for name in names}
    bare = subprocess.Popen([sys.executable, "-c", BARE, line.endpoint], cwd=ROOT, env={**os.environ, **environment})
    processes = {name: bridge.process.pid for name, bridge in bridges.items()} | {"bare bus": bare.pid}
    points: dict[str, list[tuple[float, float]]] = {name: [] for name in processes}
    links, begin_s = 0, time.monotonic()
    while time.monotonic() < begin_s + duration_s:
        wait_until(lambda: all(clients[name].angle_deg() is not None for name in ("modbus", "mqtt")), "an angle")
        time.sleep(PAUSE_S)
        if links % LOOK_EVERY == 0:
            for name, process_id in processes.items():
                points[name].append((links / 1024, resident_mib(process_id)))
        line.cut()
        time.sleep(CUT_S)
        line.mend()
        links += 1
    print(f"  {links} links opened anew in {duration_s / 60:.0f} minutes, load {os.getloadavg()[0]:.0f}", flush=True)
    for name, looked in points.items():
        print(f"  {name:<9} {describe_slope(looked, 'KiB a link')}", flush=True)
    bare.kill()
    bare.wait()
    for bridge in bridges.values():
        bridge.end()
    for client in clients.values():
        client.close()
    line.close()
    gateway.stop()
