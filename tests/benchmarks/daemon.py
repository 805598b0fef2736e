"""The daemon as a process: time to the first published sample, resident memory, CPU."""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time

import zenoh

from tests.benchmarks.chain import RATE_HZ, free_endpoint
from tests.benchmarks.process_use import cpu_s, resident_mib

RUNS = 5
SETTLE_S = 12.0


class Listener:
    """A party that listens first, so that the gateway's first message is not missed; the gateway connects to it."""

    def __init__(self) -> None:
        self.endpoint = free_endpoint()
        config = zenoh.Config()
        for key, value in (
            ("mode", "peer"),
            ("listen/endpoints", [self.endpoint]),
            ("scouting/multicast/enabled", False),
        ):
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)
        self.heard: list[tuple[int, str, bytes]] = []
        self.first = threading.Event()
        self._subscriber = self.session.declare_subscriber("plumbline/v1/**", self._hear)

    def _hear(self, sample: zenoh.Sample) -> None:
        self.heard.append((time.time_ns(), str(sample.key_expr).rsplit("/", 1)[1], sample.payload.to_bytes()))
        self.first.set()

    def close(self) -> None:
        """Leave."""
        self._subscriber.undeclare()
        self.session.close()


def start(listener: Listener, folder: str, **overrides: object) -> subprocess.Popen[bytes]:
    """`plumbline run` without the page, connected to the listener."""
    settings = {
        "PLUMBLINE_GATEWAY__DATA_DIR": folder,
        "PLUMBLINE_BUS__LISTEN": "[]",
        "PLUMBLINE_BUS__CONNECT": json.dumps([listener.endpoint]),
        "PLUMBLINE_PAGE__ENABLED": "false",
        "PLUMBLINE_DEVICE__ODR_HZ": str(RATE_HZ),
        "PLUMBLINE_DEVICE__BLOCK_SAMPLES": "32",
    } | {name: str(value) for name, value in overrides.items()}
    return subprocess.Popen([sys.executable, "-m", "gateway", "run", "--quiet"], env={**os.environ, **settings})


def main() -> None:
    """Print the figures."""
    print(f"daemon: {RATE_HZ} Hz, block 32, page off, {RUNS} runs, median (least to most)")
    first_s, resident, cpu_percent = [], [], []
    for _ in range(RUNS):
        listener = Listener()
        with tempfile.TemporaryDirectory() as folder:
            begin_s = time.monotonic()
            process = start(listener, folder)
            listener.first.wait(10)
            first_s.append(time.monotonic() - begin_s)
            time.sleep(SETTLE_S)
            resident.append(resident_mib(process.pid))
            cpu_percent.append(_cpu_percent(process.pid, 5.0))
            process.terminate()
            process.wait()
        listener.close()
    for name, values, unit in (
        ("start to first published sample", first_s, "s"),
        ("resident", resident, "MiB"),
        ("CPU, simulated crane included", cpu_percent, "% of a core"),
    ):
        print(f"  {name:<34} {statistics.median(values):8.3f} ({min(values):.3f} to {max(values):.3f}) {unit}")


def _cpu_percent(pid: int, seconds: float) -> float:
    before_s = cpu_s(pid)
    time.sleep(seconds)
    return 100 * (cpu_s(pid) - before_s) / seconds
