"""The twin on a real arm that swings freely from 93 degrees, and on a real phone that does not swing at all."""

from pathlib import Path

import numpy as np
import pytest

from gateway.measurement.rig_file import read_rig
from gateway.measurement.source import read_source
from gateway.twin.model import TwinRig, model_of
from gateway.twin.reconcile.data.data_checks import check_recording, find_fault
from tests.benchmarks.real_arm import STRETCH, FittedArm, Swing, angle_of, error_mrad, fit_arm, read_swings, rig_of
from tests.benchmarks.real_pendulum import periods, write

DATA = Path(__file__).parents[2] / "data" / "real_pendulum"
EVERY = 2
G_M_S2 = 9.80665


def thinned(swing: Swing) -> Swing:
    return Swing(swing.time_s[::EVERY], swing.angle_rad[::EVERY])


@pytest.fixture(scope="module")
def swings() -> tuple[Swing, Swing]:
    log, held_out = read_swings()
    return thinned(log), thinned(held_out)


@pytest.fixture(scope="module")
def fitted(swings: tuple[Swing, Swing]) -> dict[str, FittedArm]:
    names = {
        "viscous": ["viscous_damping"],
        "with quadratic": ["viscous_damping", "quadratic_drag"],
        "dry": ["quadratic_drag", "coulomb_friction"],
    }
    rig = rig_of(swings[0])
    return {key: fit_arm(rig, swings[0], effects) for key, effects in names.items()}


def test_recording_reaches_beyond_a_right_angle(swings: tuple[Swing, Swing]) -> None:
    log, held_out = swings
    assert np.degrees(np.abs(log.angle_rad).max()) == pytest.approx(93.0, abs=0.2)
    assert held_out.time_s[0] - log.time_s[-1] == pytest.approx(EVERY * 0.01, abs=0.011)


@pytest.mark.parametrize("heading_rad", [0.0, np.pi / 4, 1.2])
def test_adapter_keeps_the_angle_for_every_heading(swings: tuple[Swing, Swing], heading_rad: float) -> None:
    log, _ = swings
    rows = np.loadtxt(log.csv(heading_rad).splitlines(), delimiter=",", skiprows=1)
    assert angle_of(rows[:, 1:4]) == pytest.approx(log.angle_rad, abs=1e-6)
    assert rows[-1, 0] == pytest.approx(STRETCH * (log.time_s[-1] - log.time_s[0]))
    assert np.linalg.norm(rows[:, 1:4], axis=1) == pytest.approx(np.ones(len(rows)), abs=1e-6)


@pytest.mark.slow
def test_quadratic_and_coulomb_damping_predict_the_held_out_swing(
    swings: tuple[Swing, Swing], fitted: dict[str, FittedArm]
) -> None:
    assert fitted["dry"].held_out_mrad(swings[1], 3.0) <= 2.1


@pytest.mark.slow
def test_quadratic_drag_added_to_viscous_damping_makes_the_held_out_error_larger(
    swings: tuple[Swing, Swing], fitted: dict[str, FittedArm]
) -> None:
    viscous, both, dry = (fitted[key].held_out_mrad(swings[1], 3.0) for key in ("viscous", "with quadratic", "dry"))
    assert fitted["with quadratic"].log_mrad < fitted["viscous"].log_mrad
    assert viscous < both
    assert dry < viscous / 2


@pytest.mark.slow
def test_viscous_damping_vanishes_beside_quadratic_and_coulomb_damping(swings: tuple[Swing, Swing]) -> None:
    log = swings[0]
    arm = fit_arm(rig_of(log), log, ["viscous_damping", "quadratic_drag", "coulomb_friction"])
    found = {spec.effect: value for spec, value in zip(arm.simulator.effect_parameters, arm.effects, strict=True)}
    assert found["viscous_damping"] < 1e-4
    assert found["coulomb_friction"] == pytest.approx(0.0233, rel=0.03)
    assert found["quadratic_drag"] == pytest.approx(2.8e-4, rel=0.03)


@pytest.mark.slow
def test_no_damping_explains_the_whole_residual(swings: tuple[Swing, Swing], fitted: dict[str, FittedArm]) -> None:
    noise_mrad = 0.1
    assert fitted["dry"].held_out_mrad(swings[1], 18.4) > 50 * noise_mrad
    lengths_mm = [length_mm for _, _, length_mm in periods(*swings)]
    assert lengths_mm[0] - lengths_mm[-1] > 0.1  # of 153: the period becomes shorter as the swing becomes small


def test_error_is_that_of_the_angle(swings: tuple[Swing, Swing]) -> None:
    log, _ = swings
    shifted = Swing(log.time_s, log.angle_rad + 2e-3)
    assert error_mrad(log, shifted.observations().force_g) == pytest.approx(2.0, rel=1e-6)


def test_files_for_the_command_pass_its_checks(swings: tuple[Swing, Swing], tmp_path: Path) -> None:
    write(tmp_path, *swings)
    rig = read_rig(tmp_path / "rig.toml")
    for name in ("log.csv", "held_out.csv"):
        loaded = check_recording(read_source([tmp_path / name], rig), model_of(rig).rig)
        assert loaded.fault is None
        assert loaded.observations is not None


def test_phone_at_rest_is_refused() -> None:
    rows = np.loadtxt(DATA / "phone_at_rest.txt")
    force_g = rows[:, 1:4] / G_M_S2
    spread_g = force_g.std(axis=0)
    twin = TwinRig(1.0, 0.0, G_M_S2, (spread_g[0], spread_g[1], spread_g[2]))
    fault = find_fault(rows[:, 0], force_g, twin)
    assert fault is not None
    assert fault.startswith(("static", "too noisy"))
    in_m_s2 = find_fault(rows[:, 0], rows[:, 1:4], twin)
    assert in_m_s2 is not None
    assert "m/s²" in in_m_s2
