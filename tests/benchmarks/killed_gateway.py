"""A whole gateway killed at random while it is recalibrated again and again: real processes, a radio that is turned."""

import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

from gateway.bus.client import GatewayClient
from gateway.bus.session import BusError
from gateway.calibration.store import CalibrationStore
from gateway.errors import InputError
from tests.benchmarks.chain import free_endpoint
from tests.benchmarks.turned_radio import TurnedRadio

KILLS = 40
DEVICE = "witmotion-hook-7"
TOML = '[device]\nkind = "witmotion"\nport = "{port}"\nodr_hz = 400\nserial = "hook-7"\n[housing]\nposition_m = 5\n'


class Office(threading.Thread):
    """Recalibrates, commits, and begins again; the rigger beside the hook turns the sensor as it is asked to."""

    def __init__(self, endpoint: str, radio: TurnedRadio) -> None:
        super().__init__()
        self._endpoint, self._radio = endpoint, radio
        self.stopping = threading.Event()
        self.phase = "starting"
        self.committed = 0

    def run(self) -> None:
        while not self.stopping.is_set():
            try:
                client = GatewayClient(self._endpoint, "plumbline/v1/*/*/*")
            except (InputError, BusError):
                time.sleep(0.2)
                continue
            try:
                self._work(client)
            finally:
                client.close()

    def _work(self, client: GatewayClient) -> None:
        number = 0
        while not self.stopping.is_set():
            status = client.status()
            if status is None or "calibration" not in status:
                return
            session = status["calibration"]["session"]
            self.phase = session["phase"]
            if session["phase"] == "collecting":
                if session["next_face"] is not None:
                    self._radio.turn(session["next_face"])
                time.sleep(0.1)
                continue
            number += 1
            request = {"id": f"office-{time.time_ns()}-{number}", "by": "campaign", "reason": "campaign"}
            if session["phase"] == "review":
                said = client.ask("commit", request, patience_s=5.0)
                self.committed += said is not None and said.accepted
            else:
                client.ask("recalibrate", {**request, "housing_off_rope": True}, patience_s=5.0)


def main(kills: int = KILLS) -> None:
    """Kill, look at the store, start again."""
    chance = random.Random(7)
    found = Counter[str]()
    with tempfile.TemporaryDirectory() as scratch:
        folder, endpoint = Path(scratch), free_endpoint()
        radio = TurnedRadio(folder / "radio")
        office = Office(endpoint, radio)
        (folder / "gateway.toml").write_text(TOML.format(port=folder / "radio"))
        try:
            office.start()
            for _ in range(kills):
                found[_killed(folder, endpoint, chance.uniform(1.5, 6.0), office)] += 1
        finally:
            office.stopping.set()
            office.join()
            radio.close()
        history = CalibrationStore(folder / "data", DEVICE).state().history
    print(f"{kills} kills of the gateway, a whole record in force after each; phase that was killed: {dict(found)}")
    print(f"{len(history)} records were put in force, {office.committed} commits were answered")


def _killed(folder: Path, endpoint: str, after_s: float, office: Office) -> str:
    """Start, wait, kill; what the session was doing. The store must hold a whole record, or none before the first one."""
    settings = {
        "PLUMBLINE_GATEWAY__DATA_DIR": str(folder / "data"),
        "PLUMBLINE_BUS__LISTEN": json.dumps([endpoint]),
        "PLUMBLINE_PAGE__ENABLED": "false",
    }
    command = [sys.executable, "-m", "gateway", "run", "--quiet", "--config", str(folder / "gateway.toml")]
    gateway = subprocess.Popen(command, env={**os.environ, **settings}, stderr=subprocess.DEVNULL)
    time.sleep(after_s)
    phase = office.phase
    assert gateway.poll() is None, "the gateway ended by itself"
    gateway.kill()
    gateway.wait()
    store = CalibrationStore(folder / "data", DEVICE)
    record = store.in_force()
    assert (record is None) == (not store.state().history)
    return phase


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else KILLS)
