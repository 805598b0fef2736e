"""Random cuts of gateway, broker and bridges, and what consumers got meanwhile: values, alerts, and the memory that bridges keep.

script/bench bridge_cuts [--minutes N] [--seed N]: real processes all of them; bridges that hang are ended as by their service.
"""

import argparse
import json
import logging
import os
import random
import signal
import tempfile
import threading
import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader

from gateway.errors import PlumblineError
from tests.benchmarks.process_use import describe_slope, resident_mib
from tests.ports import unused_port
from tests.system.bus_query import KEY
from tests.system.conftest import BusPeer, RunningGateway
from tests.system.foxglove_client import FoxgloveClient
from tests.system.mosquitto import Subscriber
from tests.system.plant_clients import ModbusPlant, MqttPlant, OpcuaPlant
from tests.system.running_bridge import PlantClient, RunningBridge
from tests.system.test_alert_delivery import CHATTERING, stored
from tests.system.test_hung_bridge import Manager
from tests.waiting import wait_until

CUTS = ("broker restarted", "broker held", "bridge killed", "bridge held", "gateway killed", "gateway held")
LONGEST_PAUSE_S = 6.0
POLL_S = 0.25
LOOK_S = 10.0
OLDEST_S = 2.0
"""A value that a consumer sees is of a sample of this time at the most: what the issue of a plant asks for."""
ROUNDED_DEG = 0.0051
"""Half the last digit of the coarsest protocol, and that of a recording."""
Seen = list[tuple[float, float]]
"""Wall time, s, and the angle that a consumer held, degrees."""


def main(options: Sequence[str] = ()) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args(options)
    logging.disable()  # the client of OPC UA logs every attempt to connect
    print(f"bridge_cuts: simulated crane, load {os.getloadavg()[0]:.0f}, seed {chosen.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        _Cuts(Path(folder), random.Random(chosen.seed)).run(60 * chosen.minutes)


class _Cuts:
    """Two bridges of each protocol: one is cut, the other one is not and keeps its memory."""

    def __init__(self, folder: Path, chance: random.Random) -> None:
        self._folder, self._chance = folder, chance
        self._gateway = RunningGateway(folder, CHATTERING)
        self._endpoint = self._gateway.endpoint
        self._mqtt = MqttPlant(folder)
        self._broker = self._mqtt.broker
        for name in ("cut", "steady"):
            (folder / name).mkdir()
        self._clients: dict[str, PlantClient] = {
            "mqtt": self._mqtt,
            "modbus": ModbusPlant(folder),
            "opcua": OpcuaPlant(folder / "cut"),
        }
        self._viewer_port = unused_port()
        self._settings = folder / "cut" / "bridge.toml"
        lines = [client.settings for client in (self._clients["modbus"], self._clients["opcua"])]
        self._settings.write_text(
            f"demonstration = true\n{self._mqtt.settings}{''.join(lines)}"
            f'[foxglove]\nlisten = "127.0.0.1:{self._viewer_port}"\n'
        )
        self._steady_settings = folder / "steady" / "bridge.toml"
        position = folder / "steady" / "position.json"
        self._steady_settings.write_text(
            f'demonstration = true\n[mqtt]\nport = {self._broker.port}\nprefix = "steady"\nclient_id = "steady"\n'
            f'position_file = "{position}"\n[modbus]\nlisten = "127.0.0.1:{unused_port()}"\n'
            f'{OpcuaPlant(folder / "steady").settings}[foxglove]\nlisten = "127.0.0.1:{unused_port()}"\n'
        )
        self._bridges: dict[str, RunningBridge] = {}
        self._managers: list[Manager] = []
        self._ending = threading.Event()
        self._seen: dict[str, Seen] = {name: [] for name in self._clients}
        self._viewed: list[dict[str, Any]] = []
        self._complaints: Counter[str] = Counter()
        self._broker_cuts: list[tuple[float, float]] = []

    def run(self, duration_s: float) -> None:
        """Cut for a time, and print what came of it."""
        protocols = (*self._clients, "foxglove")
        steady = {name: RunningBridge(name, self._endpoint, self._steady_settings) for name in protocols}
        for name in protocols:
            self._start(name)
        alerts = {prefix: Subscriber(self._broker.port, f"{prefix}/#") for prefix in ("plumbline", "steady")}
        peer = BusPeer(self._endpoint, f"{KEY}/motion")
        wait_until(lambda: all(len(each.contents("/state")) > 30 for each in alerts.values()), "states of both bridges")
        first = len(stored(self._gateway))
        threads = [threading.Thread(target=self._poll, args=(name,)) for name in self._clients]
        threads += [threading.Thread(target=self._view)]
        for thread in threads:
            thread.start()
        resident = self._cut_for(duration_s, {name: bridge.process.pid for name, bridge in steady.items()})
        wait_until(
            lambda: all(stored(self._gateway)[-1] in _alerts(each) for each in alerts.values()), "the last alert"
        )
        self._ending.set()
        for thread in threads:
            thread.join()
        self._gateway.stop()
        time.sleep(5)
        sent = stored(self._gateway)[first:]
        for prefix, subscriber in alerts.items():
            whose = "cut" if prefix == "plumbline" else prefix
            print(f"  alerts at MQTT, {whose} bridge: {_compare(sent, _alerts(subscriber))}")
            subscriber.close()
        self._judge(_angles(self._folder / "data", peer), peer)
        for name, points in resident.items():
            print(f"  steady {name:<9} {describe_slope(points, 'MiB/h')}", flush=True)
        peer.close()
        for bridge in (*steady.values(), *self._bridges.values()):
            bridge.end()
        for manager in self._managers:
            manager.close()
        self._mqtt.close()

    def _cut_for(self, duration_s: float, processes: dict[str, int]) -> dict[str, list[tuple[float, float]]]:
        """Cut again and again; return the memory of processes meanwhile, MiB, with its times, h."""
        resident: dict[str, list[tuple[float, float]]] = {name: [] for name in processes}
        counts: Counter[str] = Counter()
        begin_s, looked_s = time.monotonic(), float("-inf")
        while (now_s := time.monotonic()) < begin_s + duration_s:
            if now_s - looked_s >= LOOK_S:
                looked_s = now_s
                for name, process_id in processes.items():
                    resident[name].append((now_s / 3600, resident_mib(process_id)))
            counts[self._cut()] += 1
            time.sleep(self._chance.uniform(1, 8))
            for name in [name for name, bridge in self._bridges.items() if bridge.process.poll() is not None]:
                counts[f"{name} bridge ended by its manager, not held"] += 1  # starved for longer than its patience
                self._bridges[name].end()
                self._start(name)
        load = os.getloadavg()[0]
        print(f"  {duration_s / 60:.0f} minutes, {counts.total()} cuts: {dict(counts)}; load {load:.0f}", flush=True)
        return resident

    def _start(self, name: str) -> None:
        folder = self._folder / f"manager-{len(self._managers)}"
        folder.mkdir()
        manager = Manager(folder)
        bridge = RunningBridge(name, self._endpoint, self._settings, environment=manager.environment)
        manager.watch(bridge.signal)
        self._managers.append(manager)
        self._bridges[name] = bridge

    def _cut(self) -> str:
        what, pause_s = self._chance.choice(CUTS), self._chance.uniform(0.5, LONGEST_PAUSE_S)
        name = self._chance.choice(sorted(self._bridges))
        begin_s = time.time()
        match what:
            case "broker restarted":
                self._broker.stop()
                time.sleep(pause_s)
                self._broker.start()
            case "broker held":
                self._broker.signal(signal.SIGSTOP)
                time.sleep(pause_s)
                self._broker.signal(signal.SIGCONT)
            case "bridge killed" | "bridge held":
                if what == "bridge killed":
                    self._bridges[name].end()
                else:
                    self._bridges[name].signal(signal.SIGSTOP)
                    self._bridges[name].process.wait()  # its manager ends it
                    self._bridges[name].end()
                time.sleep(pause_s)
                self._start(name)
                return f"{name} {what}"
            case "gateway held":
                self._gateway.process.send_signal(signal.SIGSTOP)
                time.sleep(pause_s)
                self._gateway.process.send_signal(signal.SIGCONT)
            case _:
                self._gateway.process.kill()
                self._gateway.wait()
                listen = {"PLUMBLINE_BUS__LISTEN": f'["{self._endpoint}"]'}
                self._gateway = RunningGateway(self._folder, CHATTERING, environment=listen)
        if what.startswith("broker"):
            self._broker_cuts.append((begin_s, time.time()))
        return what

    def _poll(self, name: str) -> None:
        client, seen = self._clients[name], self._seen[name]
        while not self._ending.wait(POLL_S):
            at_s = time.time()
            if (angle_deg := client.angle_deg()) is not None:
                seen.append((at_s, angle_deg))

    def _view(self) -> None:
        while not self._ending.wait(POLL_S):
            with suppress(OSError, AssertionError):
                viewer = FoxgloveClient(self._viewer_port).subscribe("/motion", "/bridge")
                try:
                    while not self._ending.is_set():
                        n_bridge = len(viewer.messages.get("/bridge", ()))
                        viewer.until(lambda n=n_bridge, v=viewer: len(v.messages.get("/bridge", ())) > n)  # type: ignore[misc]
                finally:
                    self._viewed += viewer.messages.get("/motion", ())
                    self._complaints.update(viewer.statuses.keys() - {"gateway"})
                    viewer.close()

    def _judge(self, angles: dict[int, float], peer: BusPeer) -> None:
        """Print how many of the values that consumers saw are right: stated in the last two seconds, or of a sample of then.

        A gateway without time for its samples states them late, and another listener may miss what it states after a start.
        """
        heard = [(at_ns, each) for (at_ns, _, _), each in zip(peer.heard, peer.messages("motion"), strict=False)]
        late_s = sorted((at_ns - each["time_ns"]) / 1e9 for at_ns, each in heard)
        print(f"  sample to bus: p50 {late_s[len(late_s) // 2]:.2f} s, p99 {late_s[int(0.99 * len(late_s))]:.2f} s")
        stated = [(at_ns, each["angle_deg"]) for at_ns, each in heard if each["angle_deg"] is not None]
        by_time = sorted([*angles.items(), *stated])
        for name, seen in self._seen.items():
            judged = [each for each in seen if name != "mqtt" or not self._is_broker_cut(each[0])]
            wrong = [each for each in judged if not _is_right(each, by_time)]
            print(
                f"  values at {name}: {len(judged)} seen, {len(wrong)} wrong or older than {OLDEST_S:.0f} s {wrong[:3]}"
            )
        known = [each for each in self._viewed if each["time_ns"] in angles and "angle_deg" in each]
        wrong_n = sum(abs(each["angle_deg"] - angles[each["time_ns"]]) > ROUNDED_DEG for each in known)
        print(f"  values at foxglove: {len(self._viewed)} messages, {len(known)} found again, {wrong_n} of them differ")
        print(f"  complaints of its server: {dict(self._complaints)}")

    def _is_broker_cut(self, at_s: float) -> bool:
        """Whether the broker was cut just before: its consumers have their own time-out then."""
        return any(begin_s <= at_s <= end_s + OLDEST_S for begin_s, end_s in self._broker_cuts)


def _is_right(seen: tuple[float, float], by_time: list[tuple[int, float]]) -> bool:
    at_s, angle_deg = seen
    begin, end = (bisect_left(by_time, (int((at_s + of_s) * 1e9), 0.0)) for of_s in (-OLDEST_S, 1.0))
    return any(abs(stated_deg - angle_deg) <= ROUNDED_DEG for _, stated_deg in by_time[begin:end])


def _angles(folder: Path, peer: BusPeer) -> dict[int, float]:
    """Return what the gateway has stated, by the time of the sample, from its recordings and from the bus."""
    found: dict[int, float] = {}
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as file, suppress(McapError, PlumblineError, EOFError):
            for _, _, message in NonSeekingReader(file).iter_messages(["/motion"], log_time_order=False):
                content = json.loads(message.data)
                if "angle_deg" in content:
                    found[content["time_ns"]] = content["angle_deg"]
    return found | {
        each["time_ns"]: each["angle_deg"] for each in peer.messages("motion") if each["angle_deg"] is not None
    }


def _alerts(subscriber: Subscriber) -> list[tuple[str, int]]:
    return [(each["boot_id"], each["alert_number"]) for each in subscriber.contents("/alert") if "missed" not in each]


def _compare(sent: list[tuple[str, int]], got: list[tuple[str, int]]) -> str:
    wanted = [each for each in dict.fromkeys(got) if each in set(sent)]
    is_ordered = wanted == [each for each in sent if each in set(got)]
    lost, twice = len(set(sent) - set(got)), len(got) - len(set(got))
    return f"{len(sent)} sent, {lost} lost, {twice} twice, order {'kept' if is_ordered else 'BROKEN'}"
