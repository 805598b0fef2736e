"""Samples lost without a gap in the time stamps, alone and with other effects."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.twin.effects.parameter import Value
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.sensor import noise_with_quantisation_g, quantised_moments
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.search.budget import Budget
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import make_context
from gateway.twin.reconcile.search.persistent import fit_clock_hypotheses
from gateway.twin.reconcile.timing.sample_loss import (
    SampleLossFit,
    find_sample_loss,
    retime_validation,
    viterbi_loss_count,
)
from gateway.twin.reconcile.timing.time_warp import (
    KNOT_SPACING_SAMPLES,
    effective_degrees_of_freedom,
    estimate_time_warp,
    lowpass,
    make_knots,
    marginalise_time_warp,
    noise_chi2_below_swing_frequencies,
)
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
Record = Callable[..., Observations]
FRACTION = 0.03
STEP_G = 0.003


def lose_samples(observations: Observations, fraction: float = FRACTION) -> tuple[Observations, Array]:
    """Return a recording without some samples, with even time stamps, and its true times."""
    kept = np.flatnonzero(np.random.default_rng(2).random(len(observations.time_s)) >= fraction)
    stamped = replace(
        observations,
        time_s=observations.time_s[: len(kept)],
        force_g=observations.force_g[kept],
        used=observations.used[kept],
    )
    return stamped, observations.time_s[kept]


def find_in(rig: TwinRig, observations: Observations, baseline: EffectValues | None = None) -> SampleLossFit | None:
    """Search lost samples from what a clock error leaves."""
    context = replace(
        make_context(Model(rig, {}), observations, Budget(), lambda: None), baseline_effects=baseline or {}
    )
    table = context.fit(CandidateTable(observations), context.baseline_effects)
    table = context.fit(table, {**context.baseline_effects, "clock_drift": {}}).start_round()
    found = (find_sample_loss(context.setting, each) for each in fit_clock_hypotheses(table, context))
    return next(filter(None, found), None)


def test_marginalised_time_warp_gives_the_solution_of_the_whole_problem() -> None:
    rng = np.random.default_rng(0)
    knots, variance = make_knots(38), 0.3
    residual, by_time, by_values = rng.normal(size=(38, 3)), rng.normal(size=(38, 3)), rng.normal(size=(38, 3, 2))
    smoother = marginalise_time_warp(residual, by_time, by_values, np.zeros(knots.count), knots, variance)
    step = smoother.solve([0, 1])
    warp = smoother.warp([0, 1], step)

    # The whole problem: the samples, then the steps of the walk as further observations; it starts at 0.
    hats = np.maximum(0, 1 - np.abs(np.arange(38)[:, None] / KNOT_SPACING_SAMPLES - np.arange(1, knots.count)))
    by_warp = by_time[:, :, None] * hats[:, None, :]
    steps = np.diff(np.eye(knots.count), axis=0)[:, 1:] / np.sqrt(variance)
    whole = np.block(
        [
            [by_values.reshape(-1, 2), by_warp.reshape(-1, knots.count - 1)],
            [np.zeros((knots.count - 1, 2)), steps],
        ]
    )
    right = np.concatenate([residual.ravel(), np.zeros(knots.count - 1)])
    solution = np.linalg.lstsq(whole, right, rcond=None)[0]

    assert step == pytest.approx(solution[:2])
    assert warp == pytest.approx([0.0, *solution[2:]], abs=1e-9)


def test_effective_degrees_of_freedom_are_none_without_motion_and_all_with_a_large_one() -> None:
    knots = make_knots(100)

    assert effective_degrees_of_freedom(np.zeros((100, 3)), knots, 1.0) == pytest.approx(0, abs=1e-6)
    assert effective_degrees_of_freedom(np.full((100, 3), 1e4), knots, 1.0) == pytest.approx(knots.count - 1, abs=0.01)


@pytest.mark.parametrize("effects", [{}, {"quantization": {"lsb_g": STEP_G}}], ids=["noise", "quantised"])
def test_noise_below_the_swing_frequencies_is_the_mean_of_many_draws(
    rig: TwinRig, record: Record, effects: EffectValues
) -> None:
    log, rng = record({}), np.random.default_rng(3)
    simulator = Simulator(rig, sorted(effects))
    values = simulator.values([0.10, 0.04, -0.02, 0.05, 0.0], effects)
    force_g = Simulator(rig, []).predict(values[:5], log.time_s)
    draws = []
    for _ in range(60):
        noisy_g = force_g + np.array(rig.noise_g) * rng.normal(size=force_g.shape)
        draws.append(STEP_G * np.round(noisy_g / STEP_G) if effects else noisy_g)
    deviation = (np.array(draws) - np.mean(draws, axis=0)) / log.noise_g * log.used[:, None]
    drawn = np.mean([(lowpass(each, 0.05) ** 2).sum() for each in deviation]) * 60 / 59

    assert noise_chi2_below_swing_frequencies(simulator, values, force_g, log) == pytest.approx(drawn, rel=0.02)


def test_variance_of_quantised_readings_is_largest_halfway_between_two_steps() -> None:
    halfway, on_step = quantised_moments(np.array([[0.5, 1.0, 2.0]]) * STEP_G, STEP_G, np.full(3, 5e-4))[1][0, :2]

    assert halfway == pytest.approx(STEP_G**2 / 4, rel=1e-3)
    assert on_step == pytest.approx(0.0027 * STEP_G**2, rel=1e-2)


@pytest.mark.slow
def test_lost_samples_are_counted_without_a_vibration(rig: TwinRig, record: Record) -> None:
    lossy, true_s = lose_samples(record({}))
    context = FitContext(rig, {}, lossy, lambda: None)
    simulator, initial_state = context.simulator(()), context.fit({"clock_drift": {}}).values[:5]
    warp = estimate_time_warp(simulator, initial_state, lossy, FRACTION)
    assert warp is not None
    counted = viterbi_loss_count(simulator, warp, lossy)

    assert counted.fraction == pytest.approx(1 - len(true_s) / 1200, abs=0.004)
    assert counted.reduced < 1.3


def test_a_fit_that_leaves_the_equations_of_motion_has_no_time_warp(rig: TwinRig, record: Record) -> None:
    log = record({})
    simulator = Simulator(rig, [])
    beyond = simulator.values([np.nan, 0.0, 0.0, 0.0, 0.0], {})
    assert estimate_time_warp(simulator, beyond, log, FRACTION) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("viscous_damping", {"damping_ratio": 0.004}),
        ("axis_offset", {"offset_g": (0.012, -0.008, 0.006)}),
        ("scale_error", {"relative": (-0.03, 0.04, 0.01)}),
        ("lowpass_lag", {"cutoff_hz": 0.5}),
    ],
)
def test_lost_samples_are_found_beside_another_effect(
    rig: TwinRig, record: Record, name: str, parameters: dict[str, Value]
) -> None:
    lossy, true_s = lose_samples(record({name: parameters}))
    loss = find_in(rig, lossy)

    assert loss is not None
    assert loss.time_warp.fraction == pytest.approx(1 - len(true_s) / 1200, abs=0.004)
    assert np.abs(loss.time_warp.true_s - (true_s - true_s[0])).max() < 0.1  # two samples
    assert loss.others.keys() <= {name}


@pytest.mark.slow
def test_no_further_effect_is_found_with_lost_samples_alone(rig: TwinRig, record: Record) -> None:
    loss = find_in(rig, lose_samples(record({}))[0])

    assert loss is not None
    assert loss.others == {}


@pytest.mark.slow
@pytest.mark.parametrize("damping", [{}, {"viscous_damping": {"damping_ratio": 0.004}}], ids=["alone", "damped"])
def test_slow_clock_is_not_taken_for_lost_samples(rig: TwinRig, record: Record, damping: EffectValues) -> None:
    observations = record({"clock_drift": {"relative": -FRACTION}, **damping})

    assert find_in(rig, observations) is None


@pytest.mark.slow
def test_lost_samples_are_found_in_a_quantised_recording(rig: TwinRig, record: Record) -> None:
    lossy, true_s = lose_samples(record({}))
    quantised = replace(
        lossy,
        force_g=STEP_G * np.round(lossy.force_g / STEP_G),
        noise_g=noise_with_quantisation_g(lossy, STEP_G),
    )
    loss = find_in(rig, quantised, {"quantization": {"lsb_g": STEP_G}})

    assert loss is not None
    assert set(loss.others) == {"quantization"}
    assert np.abs(loss.time_warp.true_s - (true_s - true_s[0])).max() < 0.1


@pytest.mark.slow
def test_validation_recording_has_losses_and_a_heading_of_its_own(rig: TwinRig, record: Record) -> None:
    wind: EffectValues = {"steady_wind": {"accel_m_s2": (0.3, -0.2)}}
    loss = find_in(rig, lose_samples(record(wind))[0])
    assert loss is not None
    held_out, true_s = lose_samples(record(wind, "held_out"), 0.05)
    retimed = retime_validation(FitContext(rig, {}, held_out, lambda: None), loss, held_out)

    assert np.abs(retimed.time_s - (true_s - true_s[0])).max() < 0.1
    assert np.abs(held_out.time_s - (true_s - true_s[0])).max() > 1.0
