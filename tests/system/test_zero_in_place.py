"""`remote zero` with real processes, while the load hangs still."""

import time
from pathlib import Path

import numpy as np
import pytest

from devices.tables.layout import TableLayout
from devices.tables.native import read_table
from devices.tables.replay import table_info
from gateway.calibration.acceptance import add_content_hash
from gateway.calibration.store import CalibrationStore
from tests.benchmarks.turned_radio import NOISE_G
from tests.system.conftest import JoinBus, Plumbline, StartGateway
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow


def test_zero_in_place_while_the_load_hangs_still(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path, plumbline: Plumbline
) -> None:
    """A recording of a load at rest, leaning by what the mount is off, played ten times as fast."""
    rate_hz, lean_rad = 50, np.radians(1.5)
    random = np.random.default_rng(4)
    up = np.array([np.sin(lean_rad), 0.0, np.cos(lean_rad)])
    counts = np.rint(2048 * (up + random.normal(0, NOISE_G, (rate_hz * 1200, 3)))).astype(int)
    path = tmp_path / "hanging.csv"
    path.write_text("x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in counts.tolist()))
    layout = TableLayout(axes=("x", "y", "z"), unit="counts", rate_hz=rate_hz)
    device_id = table_info(path, read_table(path, layout), units_per_g=2048).device_id
    covariance = np.diag([1e-14] * 9 + [0.01] * 3).tolist()
    parent = add_content_hash(
        {
            "format": 1,
            "device_id": device_id,
            "method": "bench",
            "created_utc": "2026-01-01T00:00:00Z",
            "software": "test",
            "by": "bench",
            "parent": None,
            "unit": "counts",
            "offset": [0, 0, 0],
            "correction_matrix": (np.eye(3) / 2048).tolist(),
            "covariance": covariance,
            "prediction_interval_g": 0.01,
            "temperature_c": None,
        }
    )
    store = CalibrationStore(tmp_path / "data", device_id)
    store.add(parent)
    store.put_in_force(parent.id, by="bench", reason="", request="bench", time_utc="2026-01-01T00:00:00Z")
    gateway = start_gateway(
        f'[device]\nkind = "replay"\npath = "{path}"\nspeed = 10\naxis_columns = ["x", "y", "z"]\nunit = "counts"\n'
        f"units_per_g = 2048\nrate_hz = {rate_hz}\n[housing]\nposition_m = 5\n"
    )
    peer = join_bus(gateway.endpoint)
    peer.wait_for("tilt", lambda tilt: tilt["axial_deg"] == pytest.approx(1.5, abs=0.1))
    zero = ("remote", "zero", "--by", "ann", "--connect", gateway.endpoint, "--credentials", gateway.data_dir)
    deadline = time.monotonic() + PATIENCE_S
    while (done := plumbline(*zero)).returncode == 1 and time.monotonic() < deadline:
        assert "static for" in done.stderr
    assert done.returncode == 0, done.stderr
    message = peer.wait_for("calibration", lambda message: message["calibration_id"] not in (None, parent.id))
    assert (message["record"]["method"], message["record"]["parent"]) == ("zero", parent.id)
    new_id = message["calibration_id"]
    tilt = peer.wait_for("tilt", lambda tilt: tilt["calibration_id"] == new_id and tilt["trusted"])
    assert tilt["axial_deg"] < 0.1
