"""Two hundred gateways on one router: messages, CPU, memory, time to see all, and the return after a restart of the router."""

import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import zenoh

from gateway.bus.fleet_client import FleetClient
from gateway.bus.session import open_session
from gateway.fleet.fleet_state import FleetState
from tests.benchmarks.fleet_gateways import PERIODS_S, REPORT_S
from tests.benchmarks.process_use import cpu_s, resident_mib

PROCESSES, GATEWAYS_EACH = 4, 50
GATEWAYS = PROCESSES * GATEWAYS_EACH
SETTLE_S, MEASURE_S, DOWN_S, PATIENCE_S = 10.0, 30.0, 5.0, 120.0
RESTARTS, STATUS_RUNS = 3, 5
PATTERN = "plumbline/v1/*/*/*"
ROOT = Path(__file__).parents[2]


class Process:
    """A process of the benchmark, with what it costs."""

    def __init__(self, *arguments: str) -> None:
        self.report: dict[str, float] = {"sent": 0, "late_s": 0.0, "connected": 0}
        self.process = subprocess.Popen([sys.executable, "-m", *arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True)

    @property
    def cpu_s(self) -> float:
        """Processor time so far."""
        return cpu_s(self.process.pid)

    @property
    def resident_mb(self) -> float:
        """Resident memory."""
        return resident_mib(self.process.pid) * 2**20 / 1e6

    def line(self) -> str:
        """Return the next line of its output."""
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def follow(self) -> None:
        """Keep the last line of its output in `report` from now on."""
        threading.Thread(target=self._follow, daemon=True).start()

    def _follow(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.report = json.loads(line)

    def kill(self) -> None:
        """End it by SIGKILL."""
        self.process.kill()
        self.process.wait()


def record_templates(folder: Path, endpoint: str) -> Path:
    """Return a file with one message of each topic of a real gateway."""
    environment = {
        **os.environ,
        "PLUMBLINE_GATEWAY__DATA_DIR": str(folder / "data"),
        "PLUMBLINE_BUS__LISTEN": json.dumps([endpoint]),
        "PLUMBLINE_PAGE__ENABLED": "false",
    }
    gateway = subprocess.Popen([sys.executable, "-m", "gateway", "run", "--quiet"], cwd=ROOT, env=environment)
    session = open_session("client", [endpoint], [], None, 20_000)
    templates: dict[str, object] = {}
    with session, session.declare_subscriber(f"{PATTERN}/*") as messages:
        end_s = time.monotonic() + PATIENCE_S
        while set(templates) < set(PERIODS_S) and time.monotonic() < end_s:
            sample = messages.recv()
            topic = str(sample.key_expr).rpartition("/")[2]
            if topic in PERIODS_S:
                templates[topic] = json.loads(sample.payload.to_bytes())
    gateway.terminate()
    gateway.wait()
    path = folder / "templates.json"
    path.write_text(json.dumps(templates))
    return path


def wait_for(condition: Callable[[], bool], what: str) -> float:
    """Return how long it takes until a condition holds."""
    begun_s = time.monotonic()
    while not condition():
        if time.monotonic() - begun_s > PATIENCE_S:
            print(f"  not within {PATIENCE_S:g} s: {what}")
            break
        time.sleep(0.02)
    return time.monotonic() - begun_s


def free_port() -> int:
    """Return a port on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def load() -> str:
    """Return the load of the machine, which other work shares."""
    return "load average " + " ".join(Path("/proc/loadavg").read_text().split()[:3])


def start_router(endpoint: str) -> Process:
    """Start `plumbline fleet router`, and wait until it listens."""
    router = Process("gateway", "fleet", "router", "--listen", endpoint)
    router.line()
    return router


def main() -> None:
    """Print all figures."""
    print(f"fleet: {GATEWAYS} gateways in {PROCESSES} processes, {os.cpu_count()} cores, {load()}")
    with ExitStack() as end, tempfile.TemporaryDirectory() as folder:
        templates = record_templates(Path(folder), f"tcp/127.0.0.1:{free_port()}")
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        routers = [start_router(endpoint)]
        end.callback(_kill_newest, routers)
        groups = [
            Process(
                "tests.benchmarks.fleet_gateways", endpoint, str(templates), str(k * GATEWAYS_EACH), str(GATEWAYS_EACH)
            )
            for k in range(PROCESSES)
        ]
        for group in groups:
            end.callback(group.kill)
        for group in groups:
            group.line()
            group.follow()
        time.sleep(SETTLE_S)
        _traffic("nobody listens", routers[0], groups, None)
        client = FleetClient(endpoint, PATTERN)
        end.callback(client.close)
        _traffic("one fleet status", routers[0], groups, client)
        with zenoh.open(_everything(endpoint)) as session, session.declare_subscriber("plumbline/v1/**", _ignore):
            _traffic("and one subscriber of all topics, samples too", routers[0], groups, client)
        _time_status(endpoint, Path(folder))
        for _ in range(RESTARTS):
            _restart(endpoint, routers, groups, client)
        print(
            f"  memory: router {routers[-1].resident_mb:.0f} MB, {groups[0].resident_mb / GATEWAYS_EACH:.1f} MB a gateway"
        )
        print(f"  {load()}")


def _kill_newest(routers: list[Process]) -> None:
    routers[-1].kill()


def _ignore(_sample: zenoh.Sample) -> None:
    pass


def _everything(endpoint: str) -> zenoh.Config:
    settings = {"mode": "client", "connect": {"endpoints": [endpoint]}, "scouting": {"multicast": {"enabled": False}}}
    return zenoh.Config.from_json5(json.dumps(settings))


def _traffic(what: str, router: Process, groups: list[Process], client: FleetClient | None) -> None:
    state = FleetState()
    before = router.cpu_s, [group.cpu_s for group in groups], time.process_time(), time.monotonic()
    sent, late_s, batches = sum(group.report["sent"] for group in groups), 0.0, 0
    while time.monotonic() - before[3] < MEASURE_S:
        time.sleep(1.0)
        late_s = max(late_s, *(group.report["late_s"] for group in groups))
        if client is not None:
            batch = client.inbox.drain()
            batches += len(batch.arrivals)
            state.receive(batch)
    passed_s = time.monotonic() - before[3]
    router_share = (router.cpu_s - before[0]) / passed_s
    gateway_share = (
        sum(group.cpu_s - before_s for group, before_s in zip(groups, before[1], strict=True)) / passed_s / GATEWAYS
    )
    own_share = (time.process_time() - before[2]) / passed_s
    connected = round(sum(group.report["connected"] for group in groups))
    put = (sum(group.report["sent"] for group in groups) - sent) / passed_s
    print(
        f"  {what}: {put:.0f} messages/s put by {connected} connected gateways, at most {late_s:.2f} s late, "
        f"{batches / passed_s:.0f} states/s; CPU: router {100 * router_share:.0f} %, "
        f"a gateway's bus {100 * gateway_share:.2f} %, listener {100 * own_share:.0f} % of a core; "
        f"router {router.resident_mb:.0f} MB; {load()}"
    )


def _time_status(endpoint: str, folder: Path) -> None:
    expected = folder / "gateways.txt"
    names = [f"site-{k % 4}/crane-{k:03d}/hook" for k in range(GATEWAYS)]
    expected.write_text("\n".join(names))
    command = [sys.executable, "-m", "gateway", "fleet", "status", "--connect", endpoint, "--expect", str(expected)]
    times_s, seen = [], []
    for _ in range(STATUS_RUNS):
        begun_s = time.monotonic()
        done = subprocess.run([*command, "--json", "-"], cwd=ROOT, capture_output=True, text=True, check=False)
        times_s.append(time.monotonic() - begun_s)
        seen.append(
            sum(gateway["alive"] and gateway["level"] != "unknown" for gateway in json.loads(done.stdout)["gateways"])
        )
    print(
        f"  fleet status: {min(seen)} to {max(seen)} of {GATEWAYS} alive with a level, "
        f"median {statistics.median(times_s):.1f} s, largest {max(times_s):.1f} s; {load()}"
    )


def _restart(endpoint: str, routers: list[Process], groups: list[Process], client: FleetClient) -> None:
    """Kill the router, start it again, and wait for all gateways; count how many connect in each fifth of a second."""
    alive: dict[str, bool] = {}

    def alive_count() -> int:
        alive.update(client.inbox.drain().alive)
        return sum(alive.values())

    def connected() -> int:
        return round(sum(group.report["connected"] for group in groups))

    alive |= dict.fromkeys((f"plumbline/v1/site-{k % 4}/crane-{k:03d}/hook" for k in range(GATEWAYS)), True)
    routers[-1].kill()
    gone_s = wait_for(lambda: alive_count() == 0 and connected() == 0, "the loss of all")
    time.sleep(DOWN_S)
    routers.append(start_router(endpoint))
    begun_s = time.monotonic()
    counts: list[int] = []
    connected_s, seen_s = 0.0, 0.0
    while not (connected_s and seen_s) and time.monotonic() - begun_s < PATIENCE_S:
        time.sleep(REPORT_S)
        counts.append(connected())
        now_s = time.monotonic() - begun_s
        connected_s = connected_s or (now_s if counts[-1] == GATEWAYS else 0.0)
        seen_s = seen_s or (now_s if alive_count() == GATEWAYS else 0.0)
    steps = [after - before for before, after in zip([0, *counts], counts, strict=False)]
    print(
        f"  restart of the router after {DOWN_S:g} s: loss seen in {gone_s:.1f} s; {counts[-1]} connected {connected_s:.1f} s "
        f"after it listens, at most {max(steps)} in {REPORT_S:g} s, all seen by the listener after {seen_s:.1f} s; "
        f"router {routers[-1].cpu_s:.1f} s of CPU since its start; {load()}"
    )


if __name__ == "__main__":
    main()
