"""Everything around the gateway broken, one by one and in pairs, at start and while it runs: what goes on, and what is said.

    python -m tests.benchmarks.fault_matrix --out matrix.json

A run passes if alerts or health come on the bus or the page (or, without both, the recording grows), the fault of each broken
part is published, sampling goes on where the sensor answers, and SIGTERM ends it within 5 s.
"""

import argparse
import itertools
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import zenoh

from tests.ports import unused_port

ROOT = Path(__file__).parents[2]
PARTS = ("bus", "disk", "page", "log", "state", "key", "device")
PUBLISHED_AS = {"bus": "bus", "page": "page", "key": "signing", "device": "device"}
"""Parts whose fault stands in the health message; the disk that hangs is the recorder's, and is named after 20 s."""
TOML = '[device]\nkind = "adxl355"\nbus = 1\nodr_hz = 125\n[housing]\nposition_m = 9.0\n'
START_S, SETTLE_S, LOOK_S, LONGEST_STOP_S = 40.0, 3.0, 3.0, 9.0


class Run:
    """One gateway with some parts broken."""

    def __init__(self, folder: Path, broken: tuple[str, ...], at_start: bool) -> None:
        self.folder, self.broken, self.at_start = folder, broken, at_start
        self.data = folder / "data"
        self.data.mkdir()
        self.router_port, self.page_port = unused_port(), unused_port()
        self.undo = ExitStack()
        self.router: zenoh.Session | None = None
        self.health: dict[str, Any] = {}
        self.alerts = 0

    def hear(self, sample: zenoh.Sample) -> None:
        if str(sample.key_expr).endswith("/health"):
            self.health = json.loads(sample.payload.to_bytes())
        elif str(sample.key_expr).endswith("/alert"):
            self.alerts += 1

    def open_router(self) -> None:
        settings = zenoh.Config()
        values = {"mode": "router", "listen/endpoints": [f"tcp/127.0.0.1:{self.router_port}"]}
        for key, value in {**values, "scouting/multicast/enabled": False}.items():
            settings.insert_json5(key, json.dumps(value))
        self.router = zenoh.open(settings)
        self.subscriber = self.router.declare_subscriber("plumbline/v1/**", self.hear)

    def close_router(self) -> None:
        if self.router is not None:
            self.subscriber.undeclare()
            self.router.close()
            self.router = None

    def damage(self, part: str) -> None:
        """Break a part."""
        match part:
            case "bus":
                self.close_router()
            case "disk":
                (self.folder / "disk").touch()
            case "device":
                (self.folder / "wire").touch()
            case "page" if self.at_start:
                self.undo.enter_context(socket.create_server(("127.0.0.1", self.page_port)))
            case "page":
                os.kill(self.page_pid(), signal.SIGKILL)
            case "state":
                for name in ("calibration/session.json", "chain.json", "calibration/adxl355-01-i2c1-1d/in_force.json"):
                    path = self.data / name
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(b"[" * 100_000)
            case "key":
                (self.data / "signing-key.pem").write_bytes(b"no key")

    def page_pid(self) -> int:
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return int(children[0])

    def start(self) -> None:
        config = self.folder / "gateway.toml"
        config.write_text(TOML)
        settings = {
            "PLUMBLINE_GATEWAY__DATA_DIR": str(self.data),
            "PLUMBLINE_BUS__MODE": "client",
            "PLUMBLINE_BUS__LISTEN": "[]",
            "PLUMBLINE_BUS__CONNECT": json.dumps([f"tcp/127.0.0.1:{self.router_port}"]),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{self.page_port}",
            "PYTHONPATH": str(ROOT),
            "HOME": str(self.folder),
        }
        self.unread, writing = os.pipe()
        if "log" in self.broken:
            os.set_blocking(writing, False)
            with suppress(BlockingIOError):
                while os.write(writing, b" " * 4096):
                    pass
            os.set_blocking(writing, True)
        command = ["run", "--service", "--config", str(config)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.benchmarks.faulty_site", str(self.folder), *command],
            cwd=ROOT,
            env={**os.environ, **settings},
            stdout=subprocess.DEVNULL,
            stderr=writing if "log" in self.broken else (self.folder / "log").open("wb"),
        )
        os.close(writing)

    def page_state(self) -> dict[str, Any]:
        with (
            suppress(OSError, ValueError),
            urlopen(f"http://127.0.0.1:{self.page_port}/api/state", timeout=2) as answer,
        ):
            state: dict[str, Any] = json.loads(answer.read())
            return state
        return {}

    def recorded_bytes(self) -> int:
        return sum(path.stat().st_size for path in self.data.glob("*.mcap"))

    def judge(self) -> list[str]:
        """Return what is wrong."""
        wrong = []
        alerts, samples = self.alerts, self.health.get("samples", 0)
        page, recorded = self.page_state(), self.recorded_bytes()
        time.sleep(LOOK_S)
        if self.process.poll() is not None:
            return [f"ended with {self.process.returncode}"]
        on_bus = self.alerts > alerts or self.health.get("samples", 0) != samples
        on_page = bool(page) and self.page_state() != page
        sensor = "device" not in self.broken
        if "bus" not in self.broken and not (self.alerts > alerts if sensor else self.health):
            wrong.append("nothing on the bus")
        if "page" not in self.broken and not on_page:
            wrong.append("nothing new on the page")
        if not (on_bus or on_page or self.recorded_bytes() > recorded):
            wrong.append("nothing anywhere")
        if "bus" not in self.broken:
            if sensor and self.health.get("samples", 0) <= samples:
                wrong.append("no samples")
            known = {**self.health.get("standing_faults", {}), **self.health.get("faults", {})}
            for part in self.broken:
                name = PUBLISHED_AS.get(part)
                if name is None or (part == "key" and (not self.at_start or "disk" in self.broken)):
                    continue
                if name not in known and f"{name}_failures" not in known:
                    wrong.append(f"the fault of {part} is not published")
        return wrong

    def await_start(self) -> None:
        """Wait for the first messages, on the bus and on the page, as far as these are not broken from the start."""
        end_s, broken = time.monotonic() + START_S, self.broken if self.at_start else ()
        while time.monotonic() < end_s:
            on_bus = "bus" in broken or (self.health if "device" in broken else self.alerts > 1)
            recorded = "disk" in broken or self.recorded_bytes()
            if on_bus and recorded and ("page" in broken or self.page_state()):
                return
            time.sleep(0.2)

    def run(self) -> dict[str, Any]:
        if "bus" not in self.broken or not self.at_start:
            self.open_router()
        if self.at_start:
            for part in self.broken:
                self.damage(part)
        self.start()
        self.await_start()
        if not self.at_start:
            for part in self.broken:
                self.damage(part)
        time.sleep(SETTLE_S)
        wrong = self.judge()
        begun_s = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        try:
            code: int | None = self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = None
        stop_s = time.monotonic() - begun_s
        if stop_s > LONGEST_STOP_S:
            wrong.append(f"ended after {stop_s:.1f} s")
        self.close_router()
        self.undo.close()
        os.close(self.unread)
        moment = "start" if self.at_start else "running"
        return {"broken": self.broken, "at": moment, "wrong": wrong, "exit_code": code, "stop_s": round(stop_s, 2)}


def main() -> int:
    """Run the matrix; 1: something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    parser.add_argument(
        "--share", type=int, nargs=2, default=(0, 1), metavar=("K", "N"), help="run every Nth, from K on"
    )
    arguments = parser.parse_args()
    cases = [(part,) for part in PARTS] + list(itertools.combinations(PARTS, 2))
    first, step = arguments.share
    results = []
    for broken, at_start in list(itertools.product(cases, (True, False)))[first::step]:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            results.append(Run(Path(folder), broken, at_start).run())
            print(results[-1], flush=True)
            arguments.out.write_text(json.dumps(results, indent=1) + "\n")
    failed = sum(bool(result["wrong"]) for result in results)
    longest_s = max(result["stop_s"] for result in results)
    print(f"{len(results)} runs, {failed} wrong, longest end after SIGTERM {longest_s} s", flush=True)
    os._exit(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
