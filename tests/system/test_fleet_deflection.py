"""The deflection of a girder from two gateways over the bus, as a person in front of a terminal sees it."""

import math
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gateway.bench.girder_deflection import Girder
from tests.system.conftest import ROOT, JoinBus, RunningGateway
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

GIRDER = Girder(half_span_m=0.8, load_offset_m=0.065)
DEFLECTION_MM = 20.0
UNLOADED_S, LOADED_S = 25.0, 30.0


def start_end(folder: Path, sensor: str, sign: int) -> RunningGateway:
    """Start a gateway at one end, which replays a girder that is loaded after `UNLOADED_S`."""
    folder.mkdir()
    random = np.random.default_rng(2 + sign)
    time_s = np.arange(round(50 * (UNLOADED_S + LOADED_S))) / 50
    force_g = np.tile([0.01, -0.02, 1.0], (len(time_s), 1)) + 2e-4 * random.standard_normal((len(time_s), 3))
    force_g[time_s > UNLOADED_S, 0] -= sign * math.sin(DEFLECTION_MM / 1000 / GIRDER.factor_m)
    recording = folder / "end.csv"
    table = np.column_stack([time_s, force_g])
    np.savetxt(recording, table, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.6f")
    toml = f'[gateway]\nsite = "yard"\ncrane = "c1"\nsensor = "{sensor}"\n[device]\nkind = "replay"\npath = "{recording}"\n'
    return RunningGateway(folder, toml)


@pytest.fixture
def ends(tmp_path: Path) -> Iterator[tuple[RunningGateway, RunningGateway]]:
    gateways = start_end(tmp_path / "west", "west", 1), start_end(tmp_path / "east", "east", -1)
    yield gateways
    for gateway in gateways:
        gateway.process.kill()
        gateway.process.communicate()


def test_two_gateways_show_the_deflection_of_a_loaded_girder(
    ends: tuple[RunningGateway, RunningGateway], join_bus: JoinBus
) -> None:
    west, east = ends
    for gateway in ends:
        join_bus(gateway.endpoint).wait_for("tilt", lambda tilt: tilt["trusted"])
    command = [
        sys.executable, "-m", "gateway", "fleet", "deflection", "plumbline/v1/yard/c1/west", "plumbline/v1/yard/c1/east",
        "--half-span-m", "0.8", "--load-offset-m", "0.065", "--zero-s", "3",
        "--connect", west.endpoint, "--connect", east.endpoint,
    ]  # fmt: skip
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    shown = subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    found_mm = [0.0]
    overdue = threading.Timer(PATIENCE_S, shown.kill)
    overdue.start()
    try:
        assert shown.stdout is not None
        for line in shown.stdout:
            if line.startswith("deflection"):
                found_mm.append(float(line.split()[1]))
            if len(found_mm) > 20 and min(found_mm[-20:]) > 0.9 * DEFLECTION_MM:
                break
    finally:
        overdue.cancel()
        shown.kill()
        shown.communicate()
    assert np.median(found_mm[-10:]) == pytest.approx(DEFLECTION_MM, abs=0.1)
    assert any(abs(value) < 0.1 for value in found_mm[1:])
