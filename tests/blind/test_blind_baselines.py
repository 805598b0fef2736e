"""The baselines' own parts, on short recordings: the base fit, and one answer from end to end."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.twin.model import TwinRig
from gateway.twin.simulator.simulator import Simulator
from tests.blind.asking import case_arguments
from tests.blind.baselines.files import Found, Measured, answer, read_measured
from tests.blind.baselines.fitting import (
    Fit,
    base_fit,
    conclude,
    covariance_of,
    first_start,
    free_on_log,
    levenberg_marquardt,
    sensible,
)
from tests.blind.cases import Case, generate
from tests.blind.plan import Plan
from tests.blind.write import write_case

pytestmark = pytest.mark.slow

SHORT_S = {"log": 24.0, "held_out": 16.0}


def written(folder: Path, *hidden: Any) -> Case:
    case = generate(Plan(0, 21, "single" if hidden else "null", hidden), SHORT_S)
    write_case(case, folder)
    return case


def test_base_fit_leaves_a_null_as_noise(tmp_path: Path) -> None:
    rig = written(tmp_path).rig
    log = read_measured(tmp_path / "log.csv", rig.noise_g)
    fit = base_fit(TwinRig(rig.length_m, rig.position_m, rig.gravity_m_s2), log)
    assert fit.cost / log.force_g.size == pytest.approx(1.0, abs=0.06)


def test_fit_finds_the_parameter_that_was_hidden(tmp_path: Path) -> None:
    case = written(tmp_path, "axis_offset")
    rig = TwinRig(case.rig.length_m, case.rig.position_m, case.rig.gravity_m_s2)
    log = read_measured(tmp_path / "log.csv", case.rig.noise_g)
    simulator = Simulator(rig, ["axis_offset"])
    values = simulator.values(list(base_fit(rig, log).values), {})
    fit = levenberg_marquardt(simulator, log, values, free_on_log(simulator))
    found = fit.effects()["axis_offset"]["offset_g"]
    assert found == pytest.approx(case.truth["effects"]["axis_offset"]["offset_g"], abs=3e-4)


def nothing(rig: TwinRig, log: Measured, held_out: Measured) -> Found:
    base = base_fit(rig, log)
    return conclude(rig, log, held_out, base, base, ())


def test_answer_has_the_form_of_a_reconciliation(tmp_path: Path) -> None:
    written(tmp_path, "axis_offset")
    report, prediction = tmp_path / "report.json", tmp_path / "prediction.csv"
    assert answer(nothing, ["reconcile", *case_arguments(tmp_path, report, prediction)]) == 0
    found = json.loads(report.read_text())
    assert (found["verdict"], found["effects"]) == ("none_missing", [])
    assert found["gap"]["after"]["held_out"] == pytest.approx(found["gap"]["before"]["held_out"])
    assert found["gap"]["before"]["held_out"] > 1.5
    assert len(prediction.read_text().splitlines()) == 1 + 16 * 50


def planar_swing(rig: TwinRig, tilt_rad: float) -> Measured:
    simulator = Simulator(rig)
    time_s = np.arange(0.0, 2.5, 0.02)
    values = simulator.values([tilt_rad, 0.0, 0.0, 0.0, 0.0], {})
    return Measured(time_s, simulator.predict(values, time_s), None, 1e-3, np.arange(len(time_s)) > 0)


@pytest.mark.parametrize(("position_m", "tilt_deg"), [(0.0, 75.0), (1.0, 40.0)])
def test_start_finds_a_large_swing_at_the_pivot_and_at_the_load(position_m: float, tilt_deg: float) -> None:
    rig = TwinRig(1.0, position_m)
    tilts_rad = first_start(rig, planar_swing(rig, np.radians(tilt_deg)))[:2]
    assert np.degrees(np.hypot(*tilts_rad)) == pytest.approx(tilt_deg, abs=10.0)


def test_event_of_the_log_is_over_when_its_end_is_held_out() -> None:
    rig = TwinRig(1.0, 0.0)
    simulator = Simulator(rig, ["impact"])
    values = simulator.values([0.1, 0.0, 0.0, 0.0, 0.0], {"impact": {"delta_v_m_s": (0.3, 0.0), "start_s": 1.0}})
    log = planar_swing(rig, 0.1)
    fit = Fit(simulator, values, 0.0, free_on_log(simulator), np.zeros((0, 0)))
    held_out = replace(log, began_s=5.0)
    found = conclude(rig, log, held_out, base_fit(rig, log), fit, ("impact",))
    assert held_out.reduced_chi2(found.prediction_g) < 1e-3


def test_parameters_that_only_their_sum_determines_have_no_finite_error() -> None:
    assert (np.diag(covariance_of(np.ones((2, 2)))) > 1e11).all()


def test_thermal_drift_is_not_fitted_to_a_recording_without_a_temperature() -> None:
    recording = planar_swing(TwinRig(1.0, 0.0), 0.1)
    assert "thermal_drift" not in sensible(recording)
    assert {"axis_offset", "viscous_damping"} < set(sensible(recording))
