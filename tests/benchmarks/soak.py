"""The gateway at 500 Hz for two hours while everything around it fails at random; what it keeps, loses and holds.

    python -m tests.benchmarks.soak --out soak.json
    python -m tests.benchmarks.soak --no-chip --out without_chip.json

The model of a chip stands at the place of the bus driver, in the gateway's process; with --no-chip a simulated crane, whose wire
cannot fail, so that the memory of the model is not counted.

Needs the right to mount in a user namespace of its own (`unshare -Urm`), for a disk that fills.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import zenoh

from gateway.bus.alert_receiver import AlertReceiver
from tests.benchmarks.process_use import describe_slope, resident_mib
from tests.ports import unused_port

ROOT = Path(__file__).parents[2]
RATE_HZ = 500
DISK_MB, QUOTA_MB = 48, 24
LOOK_S = 5.0
RECORDER = f"""
[recorder]
segment_s = 120
quota_mb = {QUOTA_MB}
"""
CHIP = f"""
[device]
kind = "adxl355"
bus = 1
odr_hz = {RATE_HZ}
[housing]
position_m = 9.0
{RECORDER}
"""
NO_CHIP = f"""
[rope]
length_m = 0.8
[housing]
position_m = 0.56
[device]
odr_hz = {RATE_HZ}
[alerts]
warn_deg = 7.2
trip_deg = 7.2
clear_deg = 7.2
{RECORDER}
"""
"""A short rope and no hysteresis, so that alerts come and go."""
STALLED_PEER = """
import json, sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config) as session:
    subscriber = session.declare_subscriber("plumbline/v1/**", lambda sample: None)
    sys.stdin.read()
    subscriber.undeclare()
"""


class Log:
    """Reads the gateway's standard error, and stops reading it for a while when told to."""

    def __init__(self, stream: Any, path: Path) -> None:
        self._stream = stream
        self._path = path
        self.read = threading.Event()
        self.read.set()
        self.wire: Counter[str] = Counter()
        self.tracebacks = 0

    def run(self) -> None:
        with self._path.open("w") as out:
            for line in self._stream:
                self.read.wait()
                out.write(line)
                out.flush()
                if line.startswith("WIRE "):
                    self.wire[line.split()[1]] += 1
                self.tracebacks += line.startswith("Traceback")


class Health:
    """The newest health message, the alerts, and the longest silences, by a session of its own."""

    def __init__(self, endpoint: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("connect/timeout_ms", "60000")
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.newest: dict[str, Any] = {}
        self.alerts = 0
        self.numbers: list[int] = []
        """Of the changes, as an alert receiver hands them out."""
        self.longest_alert_gap_s = 0.0
        self._last_s = time.monotonic()
        self._subscribers = [
            self.session.declare_subscriber("plumbline/v1/**/health", self._hear_health),
            self.session.declare_subscriber("plumbline/v1/**/alert", self._hear_alert),
        ]
        self._receiver = AlertReceiver(endpoint, since=0)

    def poll(self) -> None:
        changes = [event.change for event in self._receiver.poll(0.1) if event.change is not None]
        self.numbers += [change.alert_number for change in changes if change.alert_number is not None]

    def _hear_health(self, sample: zenoh.Sample) -> None:
        self.newest = json.loads(sample.payload.to_bytes())

    def _hear_alert(self, _sample: zenoh.Sample) -> None:
        now_s = time.monotonic()
        self.longest_alert_gap_s = max(self.longest_alert_gap_s, now_s - self._last_s)
        self._last_s = now_s
        self.alerts += 1

    def close(self) -> None:
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._receiver.close()
        self.session.close()


class Soak:
    """One run."""

    def __init__(self, folder: Path, seed: int, wire_period_s: float, *, chip: bool) -> None:
        self.random = random.Random(seed)
        self.data = folder / "data"
        self.data.mkdir()
        config = folder / "gateway.toml"
        config.write_text(CHIP if chip else NO_CHIP)
        self.endpoint = f"tcp/127.0.0.1:{unused_port()}"
        settings = {
            "PLUMBLINE_GATEWAY__DATA_DIR": str(self.data / "plumbline"),
            "PLUMBLINE_BUS__LISTEN": json.dumps([self.endpoint]),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{unused_port()}",
            "PYTHONPATH": str(ROOT),
            "HOME": str(folder),
        }
        script = f'mount -t tmpfs -o size={DISK_MB}m tmpfs "$0" && exec "$@"'
        wire = ["tests.benchmarks.faulty_wire", str(seed), str(wire_period_s)]
        gateway = [sys.executable, "-m", *(wire if chip else ["gateway"])]
        self.process = subprocess.Popen(
            ["unshare", "-Urm", "sh", "-c", script, str(self.data), *gateway, "run", "--config", str(config)],
            cwd=ROOT,
            env={**os.environ, **settings},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.log = Log(self.process.stderr, folder / "log.txt")
        threading.Thread(target=self.log.run, daemon=True).start()
        self.health = Health(self.endpoint)
        self.faults: Counter[str] = Counter()
        self.rows: list[dict[str, Any]] = []

    @property
    def page(self) -> int | None:
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return int(children[0]) if children else None

    def disk_full(self) -> None:
        filler = Path(f"/proc/{self.process.pid}/root{self.data}/filler")
        with suppress(OSError), filler.open("wb", buffering=0) as file:
            while True:
                file.write(b"\0" * 65536)
        time.sleep(self.random.uniform(5, 20))
        filler.unlink()

    def log_stalls(self) -> None:
        self.log.read.clear()
        time.sleep(self.random.uniform(5, 40))
        self.log.read.set()

    def page_is_killed(self) -> None:
        if self.page is not None:
            os.kill(self.page, signal.SIGKILL)

    def page_stops(self) -> None:
        if (page := self.page) is not None:
            os.kill(page, signal.SIGSTOP)
            time.sleep(self.random.uniform(2, 15))
            with suppress(ProcessLookupError):
                os.kill(page, signal.SIGCONT)

    def peer_stalls_and_dies(self) -> None:
        peer = subprocess.Popen([sys.executable, "-c", STALLED_PEER, self.endpoint], stdin=subprocess.PIPE)
        time.sleep(3)
        peer.send_signal(signal.SIGSTOP)
        time.sleep(self.random.uniform(2, 20))
        peer.kill()
        peer.communicate()

    def peer_comes_and_goes(self) -> None:
        peer = subprocess.Popen([sys.executable, "-c", STALLED_PEER, self.endpoint], stdin=subprocess.PIPE)
        time.sleep(self.random.uniform(2, 10))
        peer.communicate()

    def requests_flood(self) -> None:
        key = "plumbline/v1/demo-site/crane-1/hook-1/rpc/cancel"
        for _ in range(500):
            for _reply in self.health.session.get(key, payload=b"{}", timeout=1.0):
                pass

    def look(self, at_s: float) -> None:
        status = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        fields = dict(line.split(":\t", 1) for line in status if ":\t" in line)
        newest = self.health.newest
        self.rows.append(
            {
                "at_s": round(at_s, 1),
                "rss_mib": resident_mib(self.process.pid),
                "threads": int(fields["Threads"]),
                "fds": len(list(Path(f"/proc/{self.process.pid}/fd").iterdir())),
                **{
                    name: newest.get(name) for name in ("samples", "lost", "dropped", "queued", "faults", "cpu_percent")
                },
            }
        )

    def run(self, duration_s: float, mean_pause_s: float) -> None:
        kinds: list[Callable[[], None]] = [
            self.disk_full,
            self.log_stalls,
            self.page_is_killed,
            self.page_stops,
            self.peer_stalls_and_dies,
            self.peer_comes_and_goes,
            self.requests_flood,
        ]
        begun_s = time.monotonic()

        def disturb() -> None:
            while True:
                time.sleep(self.random.expovariate(1 / mean_pause_s))
                kind = self.random.choice(kinds)
                with suppress(OSError, zenoh.ZError):
                    kind()
                    self.faults[kind.__name__] += 1

        threading.Thread(target=disturb, daemon=True).start()
        while time.monotonic() - begun_s < duration_s and self.process.poll() is None:
            end_s = time.monotonic() + LOOK_S
            while time.monotonic() < end_s:
                self.health.poll()
            if self.process.poll() is None:
                self.look(time.monotonic() - begun_s)

    def result(self) -> dict[str, Any]:
        ended_early = self.process.poll() is not None
        self.process.send_signal(signal.SIGTERM)
        begun_s = time.monotonic()
        self.log.read.set()
        code = self.process.wait(30)
        numbers = self.health.numbers
        return {
            "ended_early": ended_early,
            "exit_code": code,
            "stop_s": time.monotonic() - begun_s,
            "faults": dict(self.faults),
            "wire_faults": dict(self.log.wire),
            "tracebacks": self.log.tracebacks,
            "memory": describe_slope([(row["at_s"] / 3600, row["rss_mib"]) for row in self.rows], "MiB/h"),
            "most_fds": max(row["fds"] for row in self.rows),
            "most_threads": max(row["threads"] for row in self.rows),
            "alerts": self.health.alerts,
            "alert_changes": len(numbers),
            "alert_changes_once_and_in_order": numbers == list(range(1, len(numbers) + 1)),
            "longest_alert_gap_s": self.health.longest_alert_gap_s,
            "first": self.rows[0],
            "last": self.rows[-1],
        }


def main() -> int:
    """Run and print the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=7200.0, metavar="S")
    parser.add_argument("--pause", type=float, default=20.0, metavar="S", help="mean pause between two faults")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-chip", action="store_true", help="a simulated crane in place of the model of a chip")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="rows and result, JSON")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(Path(folder), arguments.seed, arguments.pause, chip=not arguments.no_chip)
        try:
            soak.run(arguments.duration, arguments.pause)
            result = soak.result()
        finally:
            soak.process.kill()
            soak.health.close()
            arguments.out.with_suffix(".log").write_bytes((Path(folder) / "log.txt").read_bytes())
    arguments.out.write_text(json.dumps({"result": result, "rows": soak.rows}, indent=1) + "\n")
    print(json.dumps(result, indent=1))
    os._exit(0)  # without the wait for threads that sleep


if __name__ == "__main__":
    sys.exit(main())
