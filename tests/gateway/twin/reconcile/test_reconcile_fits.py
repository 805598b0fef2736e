"""Fits of one trajectory: known parameters are recovered with their uncertainty, also by a housing at the load."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext, segment_bounds
from gateway.twin.reconcile.fit.initial_conditions import rotate_about_vertical, segment_initial_conditions
from gateway.twin.reconcile.fit.multiple_shooting import FitProblem, NormalEquations, fit_model
from gateway.twin.reconcile.search.validation import evaluate_on_validation
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING
from tests.gateway.twin.reconcile.conftest import swing

Record = Callable[..., Observations]
Array = NDArray[np.float64]
NOISE_G = 1e-3
DAMPED: EffectValues = {"viscous_damping": {"damping_ratio": 0.005}}


def make_context(rig: TwinRig, observations: Observations) -> FitContext:
    return FitContext(rig, {}, observations, lambda: None)


@pytest.mark.slow
def test_wrong_rope_length_is_found_even_if_the_simulation_loses_the_phase(rig: TwinRig, record: Record) -> None:
    context = make_context(rig, record({"rope_length": {"relative_error": 0.25}}))
    fit = context.fit({"rope_length": {}}, iterations=15)

    assert fit.values[5] == pytest.approx(0.25, abs=1e-3)
    assert fit.chi2 / (3 * 1200) == pytest.approx(1, abs=0.1)


@pytest.mark.slow
def test_initial_conditions_are_found_within_their_uncertainty(rig: TwinRig, record: Record) -> None:
    fit = make_context(rig, record({})).fit({})
    sigma = np.sqrt(np.diag(fit.covariance()))

    assert np.all(np.abs(fit.values[:4] - (0.10, 0.04, -0.02, 0.05)) < 5 * sigma)
    assert np.all(sigma < 1e-3)


@pytest.mark.slow
def test_fit_is_abandoned_when_it_cannot_come_below_the_bound(rig: TwinRig, record: Record) -> None:
    effects = {"rope_length": {"relative_error": 0.25}, "steady_wind": {"accel_m_s2": (0.3, 0.1)}}
    evaluations: list[float] = []
    context = FitContext(rig, {}, record(effects), lambda: evaluations.append(1.0))
    context.fit({"viscous_damping": {}}, iterations=15)
    until_converged = len(evaluations)
    context.fit({"viscous_damping": {}}, iterations=15, give_up_above=1.15 * context.log.n_values)

    assert len(evaluations) - until_converged < until_converged


@pytest.mark.slow
def test_values_that_are_not_free_stay(rig: TwinRig, record: Record) -> None:
    simulator, observations = Simulator(rig, ["rope_length", "viscous_damping"]), record({})
    effect_values = np.array([0.02, 0.004])
    free = np.array([True] * 4 + [False, False, True])
    states = np.array([[0.10, 0.04, -0.02, 0.05, 0.0]])
    fit = fit_model(FitProblem(simulator, observations, free), states, effect_values)

    assert fit.values[4] == 0.0
    assert fit.values[5] == 0.02
    assert fit.values[6] != 0.004


def test_bounded_step_is_the_constrained_minimum() -> None:
    rng = np.random.default_rng(1)
    jacobian, residual = rng.normal(size=(40, 3)), rng.normal(size=40)
    equations = NormalEquations.from_jacobian(jacobian, residual)
    free, limit = np.ones(3, dtype=bool), np.full(3, 0.05)
    unbounded = equations.step(free, 0.0)
    step = equations.bounded_step(free, -limit, limit, 0.0)
    at_limit = np.isclose(np.abs(step), 0.05)

    assert unbounded == pytest.approx(np.linalg.lstsq(jacobian, residual, rcond=None)[0])
    assert at_limit.any()
    assert np.abs(step).max() <= 0.05
    gradient = jacobian.T @ (residual - jacobian @ step)
    assert gradient[~at_limit] == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "effects",
    [
        {"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 15.0}},
        {"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 50.0}},
        {"hoisting": {"speed_m_s": -0.1, "start_s": 12.0, "duration_s": 8.0}},
    ],
    ids=["impact before the slice", "impact in the slice", "shorter rope since"],
)
def test_validation_on_a_slice_shifts_the_times_of_events(rig: TwinRig, record: Record, effects: EffectValues) -> None:
    last_third = slice_samples(record(effects), 800, 1200)

    assert evaluate_on_validation(rig, effects, last_third).reduced_chi2 == pytest.approx(1, abs=0.1)
    assert evaluate_on_validation(rig, effects, replace(last_third, offset_s=0.0)).reduced_chi2 > 2


def rig_at(rho: float, length_m: float = 1.0) -> TwinRig:
    return TwinRig(length_m, rho * length_m, noise_g=(NOISE_G,) * 3)


def recorded(rig: TwinRig, start: Array, effects: EffectValues | None = None) -> Observations:
    """Return 30 s at 25 Hz with noise."""
    return swing(rig, effects or {}, start, np.arange(0, 30, 0.04))


def started(rig: TwinRig, amplitude_rad: float) -> Array:
    """Return an elliptical swing that starts between its turning points."""
    rate = rig.small_swing_rate_1_s
    return np.array([0.6 * amplitude_rad, 0.1, -0.7 * rate * amplitude_rad, 0.1 * rate, 0.0])


@pytest.mark.parametrize("angle_rad", [0.5, 2.0, -3.0])
def test_rotation_about_the_vertical_leaves_the_samples_of_a_large_swing_unchanged(angle_rad: float) -> None:
    simulator, time_s = Simulator(rig_at(0.6)), np.arange(0, 3, 0.05)
    start = np.array([0.9, -0.7, 1.2, 0.5, 0.3])
    rotated = rotate_about_vertical(start[None], np.array([angle_rad]), simulator.structure)[0]

    assert np.abs(rotated[:4] - start[:4]).max() > 0.3
    np.testing.assert_allclose(simulator.predict(rotated, time_s), simulator.predict(start, time_s), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.5, 1.0, 1.03])
@pytest.mark.parametrize("amplitude_rad", [0.15, 1.2])
def test_segments_that_are_fitted_one_by_one_continue_each_other(rho: float, amplitude_rad: float) -> None:
    rig = rig_at(rho)
    observations, simulator = recorded(rig, started(rig, amplitude_rad)), Simulator(rig)
    first_samples = segment_bounds(rig, {}, observations)
    starts = segment_initial_conditions(simulator, observations, np.zeros(0), first_samples)
    batch = simulator.linearise_segments(starts, np.zeros(0), observations.time_s, first_samples)

    for first, last in pairwise([*first_samples, len(observations.time_s)]):
        part = slice(first, last)
        assert (observations.residual_sigma(batch.force_g)[part] ** 2).mean() < 1.5
    gaps = batch.ends[:-1] - starts[1:]
    gaps[:, HEADING] = (gaps[:, HEADING] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(gaps).max(initial=0) < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.97, 1.0])
@pytest.mark.parametrize("amplitude_rad", [0.05, 0.3, 1.2])
def test_free_swing_at_the_load_is_one_trajectory(rho: float, amplitude_rad: float) -> None:
    rig = rig_at(rho)
    observations = recorded(rig, started(rig, amplitude_rad))

    assert FitContext(rig, {}, observations, lambda: None).fit({}).chi2 < 1.06 * observations.n_values


@pytest.mark.slow
@pytest.mark.parametrize("amplitude_rad", [0.3, 1.2])
def test_damping_shows_along_the_rope_whatever_the_sign_of_the_swing(amplitude_rad: float) -> None:
    rig = rig_at(1.0)
    for sign in (1, -1):
        observations = recorded(rig, sign * started(rig, amplitude_rad), DAMPED)
        context = FitContext(rig, {}, observations, lambda: None)
        fit = context.fit({"viscous_damping": {}})

        assert fit.chi2 < 1.06 * observations.n_values
        ratio = context.simulator(("viscous_damping",)).effects(fit.values)["viscous_damping"]["damping_ratio"]
        assert ratio == pytest.approx(0.005, rel=0.03)
