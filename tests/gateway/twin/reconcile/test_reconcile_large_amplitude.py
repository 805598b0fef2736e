"""Swings of tens of degrees: initial states from the samples, the windowed fit, and a real arm released at 93 degrees."""

import numpy as np
import pytest

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.initial_states import initial_state_from_samples, window_bounds
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.search.signatures import compute_signatures
from gateway.twin.reconcile.search.validation import evaluate_on_validation
from gateway.twin.simulator.simulator import Simulator
from tests.benchmarks.real_arm import Swing, believed_length_m, error_mrad, read_swings, rig_of
from tests.gateway.twin.reconcile.conftest import swing

LENGTH_M = 8.0
DECIMATION = 2
DAMPINGS = ("viscous_damping", "quadratic_drag", "coulomb_friction")
PAIR: EffectValues = {"quadratic_drag": {}, "coulomb_friction": {}}
DAMPED: EffectValues = {"viscous_damping": {"damping_ratio": 0.004}}


def make_rig(position_m: float) -> TwinRig:
    return TwinRig(LENGTH_M, position_m, 9.80665, (1e-4,) * 3)


def release(amplitude_rad: float, position_m: float, effects: EffectValues | None = None) -> Observations:
    """Return a minute of a swing that starts at rest at its amplitude."""
    return swing(make_rig(position_m), effects or {}, [amplitude_rad, 0, 0, 0, 0], np.arange(0, 60.0, 0.05), seed=None)


@pytest.mark.parametrize("position_m", [0.0, 4.0, 7.5])
@pytest.mark.parametrize("amplitude_rad", [0.5, 1.0, 1.4])
def test_axial_reading_gives_the_amplitude_at_every_position_of_the_housing(
    amplitude_rad: float, position_m: float
) -> None:
    assert release(amplitude_rad, position_m).amplitude_rad == pytest.approx(amplitude_rad, abs=0.03)


def test_only_a_large_amplitude_needs_a_windowed_fit() -> None:
    assert not release(0.2, 4.0).has_large_amplitude
    assert release(0.9, 4.0).has_large_amplitude


@pytest.mark.parametrize("position_m", [0.0, 4.0])
def test_windows_begin_at_the_lowest_point_with_the_rate_there(position_m: float) -> None:
    observations, rig = release(1.2, position_m), make_rig(position_m)
    first_samples = window_bounds(rig, observations)
    initial_states = initial_state_from_samples(rig, observations, first_samples, 5)
    largest_rate = 2 * np.sqrt(9.80665 / LENGTH_M) * np.sin(0.6)

    assert len(first_samples) > 3
    assert np.abs(initial_states[1:, 0]).max() < 0.1
    assert np.abs(initial_states[1:, 2]) == pytest.approx(np.full(len(first_samples) - 1, largest_rate), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("position_m", [0.0, 4.0, 7.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 45.0, -100.0])
@pytest.mark.parametrize("amplitude_deg", [60.0, 85.0, 105.0])
def test_a_state_is_read_wherever_the_swing_is(amplitude_deg: float, azimuth_deg: float, position_m: float) -> None:
    """Released in any direction, also from above the pivot: a motion from the state that is read stays near the swing."""
    rig, time_s = make_rig(position_m), np.arange(0, 30.0, 0.02)
    simulator, amplitude, azimuth = Simulator(rig, []), np.radians(amplitude_deg), np.radians(azimuth_deg)
    x, y, z = np.sin(amplitude) * np.cos(azimuth), np.sin(amplitude) * np.sin(azimuth), -np.cos(amplitude)
    truth = np.array([np.arctan2(x, -z), np.arcsin(y), 0.0, 0.03, 0.0])
    observations = swing(rig, {}, truth, time_s, seed=None)
    first_samples = [0, 30, 60, 97]
    for first, state in zip(
        first_samples, initial_state_from_samples(rig, observations, first_samples, 5), strict=True
    ):
        from_state_g = simulator.predict(state, time_s[:100])
        assert np.abs(from_state_g - observations.force_g[first : first + 100]).max() < 0.3


@pytest.mark.slow
def test_a_heading_is_found_among_six_by_windows() -> None:
    wind: EffectValues = {**DAMPED, "steady_wind": {"accel_m_s2": (0.2, 0.1)}}
    rig = make_rig(4.0)
    held_out = swing(rig, wind, [0.8, 0.1, 0, 0.1, 2.0], np.arange(0, 40.0, 0.1), seed=2)
    assert evaluate_on_validation(rig, wind, held_out).reduced_chi2 == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_a_length_stays_within_the_limits_that_the_log_sets() -> None:
    """The rope of the held-out recording is longer than what the log leaves open; no fit of it may tell so."""
    held_out = release(0.9, 4.0, {"rope_length": {"relative_error": 0.05}})
    limits = {"rope_length.relative_error": (-0.01, 0.01)}
    found = evaluate_on_validation(make_rig(4.0), {"rope_length": {"relative_error": 0.0}}, held_out, limits=limits)

    assert "rope_length.relative_error" in found.refitted_parameters
    assert abs(found.fit.values[-1]) <= 0.01


@pytest.fixture(scope="module")
def arm() -> tuple[Swing, Swing]:
    log, held_out = (Swing(s.time_s[::DECIMATION], s.angle_rad[::DECIMATION]) for s in read_swings())
    assert believed_length_m(log) == pytest.approx(15.31, abs=0.02)
    return log, held_out


@pytest.fixture(scope="module")
def context(arm: tuple[Swing, Swing]) -> FitContext:
    return FitContext(rig_of(arm[0]), {}, arm[0].observations(), lambda: None)


@pytest.fixture(scope="module")
def undamped(context: FitContext) -> Fit:
    return context.fit({})


@pytest.mark.slow
def test_nominal_model_gives_a_finite_trajectory_though_it_cannot_follow_the_arm(
    context: FitContext, undamped: Fit
) -> None:
    assert context.log.reduced_chi2(undamped.force_g) > 1e6


@pytest.mark.slow
def test_score_test_ranks_the_losses_first(context: FitContext, undamped: Fit) -> None:
    signatures = compute_signatures(
        context, undamped, {}, (*DAMPINGS, "rope_length", "axis_offset", "scale_error", "steady_wind")
    )
    ranked = sorted(signatures.of, key=lambda name: -signatures.predicted_chi2_drop(name))
    assert set(ranked[:2]) <= set(DAMPINGS)


@pytest.mark.slow
def test_drag_and_friction_of_the_arm_are_found_and_hold_on_the_validation_recording(
    arm: tuple[Swing, Swing], context: FitContext, undamped: Fit
) -> None:
    viscous, pair = context.fit({"viscous_damping": {}}), context.fit(PAIR)
    assert error_mrad(arm[0], pair.force_g) < 3.0
    assert error_mrad(arm[0], viscous.force_g) > 8.0
    found = context.simulator(tuple(PAIR)).effects(pair.values)
    assert found["coulomb_friction"]["decel_m_s2"] == pytest.approx(0.0233, rel=0.03)
    assert found["quadratic_drag"]["drag_per_m"] == pytest.approx(2.8e-4, rel=0.03)
    held_out = arm[1].observations()
    before, after = (
        evaluate_on_validation(context.rig, {}, held_out),
        evaluate_on_validation(context.rig, found, held_out),
    )
    assert (before.reduced_chi2 - after.reduced_chi2) / before.reduced_chi2 > 0.95
    assert error_mrad(arm[1], after.fit.force_g) < 13.0


def test_housing_that_hangs_askew_is_no_large_swing() -> None:
    """A load at rest under a housing askew by 35 degrees reads cos 35 along z, as the top of a swing of 35 degrees does."""
    askew: EffectValues = {"mount_misalignment": {"deg": (25.0, -25.0)}}
    small, large = release(0.1, 3.0, askew), release(0.8, 3.0)

    assert not small.has_large_amplitude
    assert small.amplitude_rad == pytest.approx(0.1, abs=0.05)
    assert large.has_large_amplitude
