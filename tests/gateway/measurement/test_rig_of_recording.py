"""A rig that states no rope length, and one with a fault."""

from pathlib import Path

import numpy as np
import pytest

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from gateway.errors import InputError
from gateway.measurement.rig_file import read_rig_of_recording
from gateway.measurement.source import read_source

LENGTH_M, POSITION_M = 3.0, 1.0
HOUSING = f"[housing]\nposition_m = {POSITION_M}\n"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A pendulum that swings from 25 degrees and decays, by its equation, read at a third of the rope."""
    return write_swing(tmp_path / "log.csv", POSITION_M)


def write_swing(path: Path, position_m: float) -> Path:
    """Write the pendulum as a housing at a distance from the pivot reads it."""
    angle, rate, step_s, rows = np.radians(25.0), 0.0, 1e-3, []
    for i in range(40_000):
        acceleration = -STANDARD_GRAVITY_M_S2 / LENGTH_M * np.sin(angle) - 0.02 * rate
        if i % 20 == 0:
            along = np.cos(angle) + position_m * rate**2 / STANDARD_GRAVITY_M_S2
            across = np.sin(angle) + position_m * acceleration / STANDARD_GRAVITY_M_S2
            rows.append((i * step_s, across, 0.0, along))
        rate += step_s * acceleration
        angle += step_s * rate
    table = np.array(rows)
    table[:, 1:] += np.random.default_rng(3).normal(0, 1e-3, (len(table), 3))
    np.savetxt(path, table, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.6f")
    return path


@pytest.mark.slow
def test_a_length_by_the_period_is_refined_by_a_fitted_pendulum(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(HOUSING)
    found = read_rig_of_recording(path, [log])
    refined = found.refined_by(read_source([log], found.rig))
    assert found.rig.rope.length_m == pytest.approx(LENGTH_M, rel=0.05)
    assert refined.rig.rope.length_m == pytest.approx(LENGTH_M, rel=2e-3)
    assert "by a pendulum fitted" in refined.remarks[-1]


def test_a_stated_length_stays(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(f"[rope]\nlength_m = 3.1\n{HOUSING}")
    found = read_rig_of_recording(path, [log])
    assert found.refined_by(read_source([log], found.rig)) == found
    assert (found.rig.rope.length_m, found.remarks) == (3.1, ())


def test_a_wrong_value_is_told_even_where_the_rope_is_left_out(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("[housing]\nposition_m = -1\n")
    with pytest.raises(InputError, match=r"housing\.position_m: Input should be greater than or equal to 0$"):
        read_rig_of_recording(path, [log])


def test_a_housing_may_be_below_a_length_by_the_period(tmp_path: Path) -> None:
    """A rigid arm swings like a shorter pendulum, and its board may sit at its end."""
    path = tmp_path / "rig.toml"
    path.write_text("[housing]\nposition_m = 3.9\n")
    found = read_rig_of_recording(path, [write_swing(tmp_path / "log.csv", 3.9)])
    assert found.rig.rope.length_m == pytest.approx(LENGTH_M, rel=0.05)
    assert found.rig.housing.position_m == 3.9
