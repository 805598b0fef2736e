"""`plumbline measure` as a command: the published JSON, from a CSV and from the gateway's own recording."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from devices.pendulum.pendulum import start_motion
from devices.simulated.crane import Crane
from tests.gateway.recording.recorded_files import summarise
from tests.system.conftest import Plumbline, StartGateway

pytestmark = pytest.mark.slow

LENGTH_M, POSITION_M, RATE_HZ, NOISE_G = 9.0, 4.5, 50.0, 0.0004
RIG = f"""
[rope]
length_m = {1.15 * LENGTH_M}
[housing]
position_m = {POSITION_M}
[sensor]
sample_rate_hz = {RATE_HZ}
noise_g = {NOISE_G}
full_scale_g = 2.0
[site]
gravity_m_s2 = 9.80665
"""


def write_recording(path: Path, angle_deg: float, seconds: float = 40.0) -> None:
    crane = Crane(
        length_m=LENGTH_M,
        position_m=POSITION_M,
        gravity_m_s2=9.80665,
        motion=start_motion(math.radians(angle_deg), 0.0, 0.0, 0.0),
    )
    time_s = np.arange(0, seconds, 1 / RATE_HZ)
    force_g = np.concatenate([crane.specific_force_m_s2(part) for part in np.array_split(time_s, 20)]) / 9.80665
    force_g += np.random.default_rng(3).normal(0, NOISE_G, force_g.shape)
    rows = np.column_stack([time_s, force_g])
    np.savetxt(path, rows, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.7f")


@pytest.mark.parametrize("angle_deg", [2.0, 10.0])
def test_the_estimate_is_right_at_mid_rope_where_the_formulas_fail(
    plumbline: Plumbline, tmp_path: Path, angle_deg: float
) -> None:
    write_recording(tmp_path / "log.csv", angle_deg)
    (tmp_path / "rig.toml").write_text(RIG)
    done = plumbline("measure", tmp_path / "log.csv", "--rig", tmp_path / "rig.toml", "--json", tmp_path / "out.json")
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads((tmp_path / "out.json").read_text())
    low, high = found["swing"]["coverage95_deg"]
    assert low < angle_deg < high
    assert found["swing"]["phi_max_deg"] == pytest.approx(angle_deg, abs=0.02)
    assert found["swing"]["period_s"] == pytest.approx(2 * math.pi * math.sqrt(LENGTH_M / 9.80665), rel=2e-3)
    assert found["formulas_deg"]["arcsin_max_axy"] == pytest.approx(angle_deg / 2, rel=0.1)
    assert found["formulas_corrected_deg"]["arcsin_max_axy"] == pytest.approx(angle_deg, rel=0.05)
    assert found["conditions"]["verdict"] == "swinging"
    assert found["samples"]["count"] == 2000
    assert len(found["swings"]) >= 5
    for swing in found["swings"][1:-1]:
        assert swing["formulas_deg"]["arcsin_max_axy"] == pytest.approx(angle_deg / 2, rel=0.1)
        assert swing["formulas_corrected_deg"]["arcsin_max_axy"] == pytest.approx(swing["phi_max_deg"], rel=0.05)
    assert set(found["tilt"]) == {
        "pitch_deg",
        "roll_deg",
        "roll_gamma_deg",
        "axial_deg",
        "plain_pitch_deg",
        "plain_roll_deg",
    }


def test_rest_has_no_swing_but_an_upper_limit(plumbline: Plumbline, tmp_path: Path) -> None:
    write_recording(tmp_path / "log.csv", 0.0)
    (tmp_path / "rig.toml").write_text(RIG)
    plumbline("measure", tmp_path / "log.csv", "--rig", tmp_path / "rig.toml", "--json", tmp_path / "out.json")
    found = json.loads((tmp_path / "out.json").read_text())
    assert found["swing"] is None
    assert 0 < found["swing_upper_bound_deg"] < 0.3
    assert found["conditions"]["verdict"] == "static"


def test_without_a_rig_the_swing_is_unknown_with_a_reason(plumbline: Plumbline, tmp_path: Path) -> None:
    write_recording(tmp_path / "log.csv", 5.0)
    done = plumbline("measure", tmp_path / "log.csv")
    assert done.returncode == 0
    assert "unknown: where the housing is on the rope is not known: give --rig" in done.stdout


def test_files_of_a_gateway_are_one_recording_that_needs_no_rig(
    start_gateway: StartGateway, plumbline: Plumbline, tmp_path: Path
) -> None:
    gateway = start_gateway("[recorder]\nsegment_s = 3\n", arguments=("--duration", "12"))
    assert gateway.wait()[0] == 0
    if summarise(gateway.recordings[-1]).samples.count == 0:  # it ended at the beginning of a segment
        gateway.recordings[-1].unlink()
    first, *_, last = gateway.recordings
    last.write_bytes(last.read_bytes()[:-20])  # as of a gateway that still writes it
    done = plumbline("measure", gateway.data_dir, "--json", "-")
    assert (done.returncode, done.stderr) == (0, "")
    whole = json.loads(done.stdout)
    assert whole["files"] == [str(path) for path in gateway.recordings]
    assert whole["samples"]["lost"] == 0
    assert whole["samples"]["duration_s"] > 8
    assert whole["calibration"].startswith("factory")
    assert [remark.split(":")[0] for remark in whole["remarks"]] == [last.name]
    assert whole["swing"]["phi_max_deg"] == pytest.approx(1.8, abs=0.1)
    part = plumbline("measure", *gateway.recordings, "--from", "1", "--to", "0:08", "--json", tmp_path / "part.json")
    assert f"{len(gateway.recordings)} files, {first} to {last.name}" in part.stdout
    assert "remark       " in part.stdout
    found = json.loads((tmp_path / "part.json").read_text())
    assert found["interval"]["from_s"] == pytest.approx(1, abs=0.01)
    assert found["samples"]["duration_s"] == pytest.approx(7, abs=0.02)
    again = plumbline("measure", gateway.data_dir, "--from", found["interval"]["from_utc"], "--to", "8", "--json", "-")
    assert json.loads(again.stdout)["samples"]["count"] == found["samples"]["count"]
    outside = plumbline("measure", gateway.data_dir, "--from", "60:00")
    assert outside.returncode == 2
    assert "--from 60:00: is after the recording, which is 0 to " in outside.stderr


@pytest.mark.parametrize(("turning_dps", "verdict"), [(0.0, "static"), (10.0, "disturbed")])
def test_angular_rates_of_a_recording_enter_the_condition(
    plumbline: Plumbline, tmp_path: Path, turning_dps: float, verdict: str
) -> None:
    write_recording(tmp_path / "log.csv", 0.0, seconds=20.0)
    header, *rows = (tmp_path / "log.csv").read_text().splitlines()
    lines = [f"{header},gx_dps,gy_dps,gz_dps", *(f"{row},0.01,-0.02,{turning_dps}" for row in rows)]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "rig.toml").write_text(RIG)
    plumbline("measure", tmp_path / "log.csv", "--rig", tmp_path / "rig.toml", "--json", tmp_path / "out.json")
    assert json.loads((tmp_path / "out.json").read_text())["conditions"]["verdict"] == verdict
