"""`plumbline measure` on a table of the two axes in the plane of a swing."""

import json
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.main import main
from tests.gateway.swing.held_pendulum import GRAVITY_M_S2, readings_g, swing


@pytest.fixture
def radio_board(tmp_path: Path) -> list[str]:
    """Return arguments for a board at the end of a line of 0.4 m: z, x, time in ms, in steps of 16 mg."""
    amplitude_rad = np.radians([40.0])
    time_w0, motion = swing(amplitude_rad, 0 * amplitude_rad, np.array([0.003]), 8)
    force_g = readings_g(motion[:, 0], 0.9)[0] + np.random.default_rng(4).normal(0.0, 0.004, (len(time_w0), 3))
    time_ms = np.rint(1e3 * time_w0 * np.sqrt(0.4 / GRAVITY_M_S2))
    table = np.column_stack([np.round(force_g[:, [2, 0]] / 0.016) * 16, time_ms])
    log, rig = tmp_path / "L1.txt", tmp_path / "rig.toml"
    np.savetxt(log, table, "%d", "\t")
    rig.write_text("[rope]\nlength_m = 0.4\n[housing]\nposition_m = 0.36\n")
    return ["measure", str(log), "--rig", str(rig), "--unit", "mg", "--time", "3:ms", "--json", "-", "--columns"]


@pytest.mark.slow
def test_two_axes_give_an_interval(radio_board: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*radio_board, "2,1"]) == 0
    found = json.loads(capsys.readouterr().out)
    low_deg, high_deg = found["swing"]["coverage95_deg"]
    assert low_deg < 40.0 < high_deg
    assert found["swing_reasons"][0].startswith("y is not recorded")


def test_one_axis_is_refused_with_what_to_record(radio_board: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main([*radio_board, "2"])
    assert "one axis, which shows no angle without the one along the rope" in capsys.readouterr().err
