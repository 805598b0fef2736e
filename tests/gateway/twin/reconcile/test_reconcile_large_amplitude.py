"""Swings of tens of degrees: starts read off the data, pieces first, and a real arm from 93 degrees."""

import numpy as np
import pytest

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations, make_observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.validation import evaluate_on_validation
from gateway.twin.reconcile.fit.windowed_fit import (
    fit_windows,
    initial_state_from_samples,
    window_bounds,
)
from gateway.twin.reconcile.search.score_test import compute_signatures
from gateway.twin.simulator.simulator import Simulator
from tests.benchmarks.real_arm import Swing, believed_length_m, error_mrad, read_swings, rig_of

LENGTH_M, EVERY = 8.0, 2
DAMPINGS = ("viscous_damping", "quadratic_drag", "coulomb_friction")
PAIR: EffectValues = {"quadratic_drag": {}, "coulomb_friction": {}}
HIDDEN = {"viscous_damping": {"damping_ratio": 0.004}}


def released(
    amplitude: float, position_m: float, hidden: EffectValues | None = None, seconds: float = 60.0
) -> Observations:
    rig = TwinRig(LENGTH_M, position_m, 9.80665, (1e-4,) * 3)
    time_s = np.arange(0, seconds, 0.05)
    simulator = Simulator(rig, sorted(hidden or {}))
    force_g = simulator.predict(simulator.values([amplitude, 0, 0, 0, 0], hidden or {}), time_s)
    return make_observations(time_s, force_g, None, np.array(rig.noise_g))


@pytest.mark.parametrize("position_m", [0.0, 4.0, 7.5])
@pytest.mark.parametrize("amplitude", [0.5, 1.0, 1.4])
def test_amplitude_is_read_off_the_axis_of_the_rope_wherever_the_housing_sits(
    amplitude: float, position_m: float
) -> None:
    assert released(amplitude, position_m).amplitude_rad == pytest.approx(amplitude, abs=0.03)


def test_a_small_swing_is_fitted_as_before() -> None:
    assert not released(0.2, 4.0).has_large_amplitude
    assert released(0.9, 4.0).has_large_amplitude


@pytest.mark.parametrize("position_m", [0.0, 4.0])
def test_pieces_of_a_wide_swing_begin_at_the_lowest_point_with_the_rate_there(position_m: float) -> None:
    o = released(1.2, position_m)
    rig = TwinRig(LENGTH_M, position_m, 9.80665, (1e-4,) * 3)
    firsts = window_bounds(rig, o)
    starts = initial_state_from_samples(rig, o, firsts, 5)
    fastest = 2 * np.sqrt(9.80665 / LENGTH_M) * np.sin(0.6)
    assert len(firsts) > 3
    assert np.abs(starts[1:, 0]).max() < 0.1
    assert np.abs(starts[1:, 2]) == pytest.approx(np.full(len(firsts) - 1, fastest), rel=0.05)


@pytest.mark.slow
def test_pieces_find_the_effect_from_nothing_and_leave_what_is_held() -> None:
    o = released(1.2, 4.0, HIDDEN)
    rig = TwinRig(LENGTH_M, 4.0, 9.80665, (1e-4,) * 3)
    simulator, firsts = Simulator(rig, ["viscous_damping"]), window_bounds(rig, o)
    starts = initial_state_from_samples(rig, o, firsts, 5)
    free = np.array([True])
    assert fit_windows(simulator, o, starts, np.zeros(1), free, firsts)[1] == pytest.approx([0.004], rel=0.01)
    assert fit_windows(simulator, o, starts, np.zeros(1), ~free, firsts)[1] == pytest.approx([0.0])


@pytest.fixture(scope="module")
def arm() -> tuple[Swing, Swing]:
    log, held_out = (Swing(s.time_s[::EVERY], s.angle_rad[::EVERY]) for s in read_swings())
    assert believed_length_m(log) == pytest.approx(15.31, abs=0.02)
    return log, held_out


@pytest.fixture(scope="module")
def setting(arm: tuple[Swing, Swing]) -> FitContext:
    return FitContext(rig_of(arm[0]), {}, arm[0].observations(), lambda: None)


@pytest.fixture(scope="module")
def undamped(setting: FitContext) -> Fit:
    return setting.fit({})


@pytest.mark.slow
def test_model_as_believed_is_a_finite_motion_though_it_cannot_follow(setting: FitContext, undamped: Fit) -> None:
    assert setting.log.reduced_chi2(undamped.force_g) > 1e6


@pytest.mark.slow
def test_dampings_stand_out_of_all_lasting_effects_before_any_is_fitted(setting: FitContext, undamped: Fit) -> None:
    scored = compute_signatures(
        setting, undamped, {}, (*DAMPINGS, "rope_length", "axis_offset", "scale_error", "steady_wind")
    )
    ranked = sorted(scored.of, key=lambda name: -scored.predicted_chi2_drop(name))
    assert set(ranked[:2]) <= set(DAMPINGS)


@pytest.mark.slow
def test_drag_and_friction_are_found_from_nothing_and_hold_on_what_was_held_out(
    arm: tuple[Swing, Swing], setting: FitContext, undamped: Fit
) -> None:
    viscous, pair = setting.fit({"viscous_damping": {}}), setting.fit(PAIR)
    assert error_mrad(arm[0], pair.force_g) < 3.0
    assert error_mrad(arm[0], viscous.force_g) > 8.0
    found = setting.simulator(tuple(PAIR)).effects(pair.values)
    assert found["coulomb_friction"]["decel_m_s2"] == pytest.approx(0.0233, rel=0.03)
    assert found["quadratic_drag"]["drag_per_m"] == pytest.approx(2.8e-4, rel=0.03)
    held_out = arm[1].observations()
    before, after = (
        evaluate_on_validation(setting.rig, {}, held_out),
        evaluate_on_validation(setting.rig, found, held_out),
    )
    assert (before.reduced_chi2 - after.reduced_chi2) / before.reduced_chi2 > 0.95
    assert error_mrad(arm[1], after.fit.force_g) < 13.0
