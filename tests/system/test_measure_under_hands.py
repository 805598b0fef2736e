"""`plumbline measure` on a recording that begins under a hand: what is judged, and the length that the rig leaves out."""

import json
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.main import main
from tests.gateway.swing.held_pendulum import GRAVITY_M_S2, readings_g, swing


@pytest.mark.slow
def test_the_period_states_the_length_that_the_rig_leaves_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    amplitude_rad = np.radians([35.0])
    time_w0, motion = swing(amplitude_rad, 0 * amplitude_rad, np.array([0.002]), 12)
    force_g, _ = readings_g(motion[:, 0], 0.5)
    force_g = force_g + np.random.default_rng(1).normal(0.0, 0.001, force_g.shape)
    held_g = np.array([np.sin(amplitude_rad[0]), 0.0, np.cos(amplitude_rad[0])]) + np.zeros((60, 3))
    held_g += np.random.default_rng(2).normal(0.0, 0.001, held_g.shape)
    rows = np.concatenate([held_g, force_g])
    interval_s = (time_w0[1] - time_w0[0]) * np.sqrt(0.8 / GRAVITY_M_S2)
    log, rig = tmp_path / "log.csv", tmp_path / "rig.toml"
    table = np.column_stack([interval_s * np.arange(len(rows)), rows])
    np.savetxt(log, table, "%.6f", ",", header="time_s,ax_g,ay_g,az_g", comments="")
    rig.write_text("[housing]\nposition_m = 0.4\n")
    assert main(["measure", str(log), "--rig", str(rig), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["free_swing"]["from_s"] == pytest.approx(60 * interval_s, abs=0.3)
    assert found["free_swing"]["not_judged_s"] == found["free_swing"]["held_s"] != []
    assert any("by the period" in remark for remark in found["remarks"])
    assert found["swing"]["length_m"] == pytest.approx(0.8, rel=0.01)
    low_deg, high_deg = found["swing"]["coverage95_deg"]
    assert low_deg < 35.0 < high_deg
    assert found["swing"]["period_measured_s"] > found["swing"]["period_s"]
