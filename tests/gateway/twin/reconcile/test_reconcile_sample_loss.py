"""Samples lost without a trace beside another effect: both come back, and neither is seen where it is not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.artefact_detectors import noise_with_quantisation_g
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.search.candidates import CandidateFit, make_candidate
from gateway.twin.reconcile.timing.sample_loss import find_sample_loss, retime_validation
from gateway.twin.reconcile.timing.time_warp_smoother import (
    KNOT_SPACING_SAMPLES,
    effective_degrees_of_freedom,
    make_knots,
    marginalise_time_warp,
)
from tests.gateway.twin.swings import Array
from tests.values import present

FRACTION = 0.03
STEP_G = 0.003


def lossy(observations: Observations, fraction: float = FRACTION) -> tuple[Observations, Array]:
    kept = np.flatnonzero(np.random.default_rng(2).random(len(observations.time_s)) >= fraction)
    stamped = replace(
        observations,
        time_s=observations.time_s[: len(kept)],
        force_g=observations.force_g[kept],
        used=observations.used[kept],
    )
    return stamped, observations.time_s[kept]


def slow_clock(
    rig: TwinRig, observations: Observations, always: EffectValues | None = None
) -> tuple[FitContext, CandidateFit]:
    setting = FitContext(rig, {}, observations, lambda: None)
    values = {**(always or {}), "clock_drift": {}}
    return setting, present(make_candidate(setting, values, setting.fit(values)))


def test_putting_the_walk_in_changes_no_solution() -> None:
    rng = np.random.default_rng(0)
    knots, spread = make_knots(38), 0.3
    residual, by_time, by_values = rng.normal(size=(38, 3)), rng.normal(size=(38, 3)), rng.normal(size=(38, 3, 2))
    equations = marginalise_time_warp(residual, by_time, by_values, np.zeros(knots.count), knots, spread)
    step, drop = equations.solve([0, 1])
    walk = equations.walk([0, 1], step)

    # The same in one: readings, then the walk's steps as readings of their own; it begins at 0.
    hats = np.maximum(0, 1 - np.abs(np.arange(38)[:, None] / KNOT_SPACING_SAMPLES - np.arange(1, knots.count)))
    by_walk = by_time[:, :, None] * hats[:, None, :]
    steps = np.diff(np.eye(knots.count), axis=0)[:, 1:] / np.sqrt(spread)
    whole = np.block(
        [
            [by_values.reshape(-1, 2), by_walk.reshape(-1, knots.count - 1)],
            [np.zeros((knots.count - 1, 2)), steps],
        ]
    )
    right = np.concatenate([residual.ravel(), np.zeros(knots.count - 1)])
    known, without = (np.linalg.lstsq(each, right, rcond=None)[0] for each in (whole, whole[:, 2:]))

    assert step == pytest.approx(known[:2])
    assert walk == pytest.approx([0.0, *known[2:]], abs=1e-9)
    assert drop == pytest.approx(((right - whole[:, 2:] @ without) ** 2).sum() - ((right - whole @ known) ** 2).sum())


def test_readings_that_do_not_change_tell_no_step_of_time_and_loud_ones_all() -> None:
    knots = make_knots(100)

    assert effective_degrees_of_freedom(np.zeros((100, 3)), knots, 1.0) == pytest.approx(0, abs=1e-6)
    assert effective_degrees_of_freedom(np.full((100, 3), 1e4), knots, 1.0) == pytest.approx(knots.count - 1, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden",
    [
        {"viscous_damping": {"damping_ratio": 0.004}},
        {"axis_offset": {"offset_g": (0.012, -0.008, 0.006)}},
        {"scale_error": {"relative": (-0.03, 0.04, 0.01)}},
        {"lowpass_lag": {"cutoff_hz": 0.5}},
    ],
    ids=lambda hidden: next(iter(hidden)),
)
def test_lost_samples_and_what_acts_beside_them_are_told_together(
    rig: TwinRig, record: Callable[..., Observations], hidden: EffectValues
) -> None:
    observations, true_s = lossy(record(hidden))
    lost = find_sample_loss(*slow_clock(rig, observations))
    name = next(iter(hidden))

    assert lost is not None
    assert lost.walk.fraction == pytest.approx(1 - len(true_s) / 1200, abs=0.004)
    assert np.abs(lost.walk.true_s - (true_s - true_s[0])).max() < 0.1  # two samples
    assert set(lost.others) == {name}
    for parameter, value in hidden[name].items():
        assert lost.others[name][parameter] == pytest.approx(value, rel=0.25, abs=0.01)


@pytest.mark.slow
def test_nothing_is_put_beside_lost_samples_where_nothing_is(rig: TwinRig, record: Callable[..., Observations]) -> None:
    observations, _ = lossy(record({}))
    lost = find_sample_loss(*slow_clock(rig, observations))

    assert lost is not None
    assert lost.others == {}


@pytest.mark.slow
@pytest.mark.parametrize("damping", [{}, {"viscous_damping": {"damping_ratio": 0.004}}], ids=["alone", "damped"])
def test_a_clock_that_runs_slow_loses_no_samples(
    rig: TwinRig, record: Callable[..., Observations], damping: EffectValues
) -> None:
    observations = record({"clock_drift": {"relative": -FRACTION}, **damping})

    assert find_sample_loss(*slow_clock(rig, observations)) is None


@pytest.mark.slow
def test_lost_samples_are_seen_in_coarse_steps(rig: TwinRig, record: Callable[..., Observations]) -> None:
    observations, true_s = lossy(record({}))
    stepped = replace(
        observations,
        force_g=STEP_G * np.round(observations.force_g / STEP_G),
        noise_g=noise_with_quantisation_g(observations, STEP_G),
    )
    lost = find_sample_loss(*slow_clock(rig, stepped, {"quantization": {"lsb_g": STEP_G}}))

    assert lost is not None
    assert set(lost.others) == {"quantization"}
    assert np.abs(lost.walk.true_s - (true_s - true_s[0])).max() < 0.1


@pytest.mark.slow
def test_the_held_out_recording_has_losses_and_a_heading_of_its_own(
    rig: TwinRig, record: Callable[..., Observations]
) -> None:
    wind = {"steady_wind": {"accel_m_s2": (0.3, -0.2)}}
    lost = present(find_sample_loss(*slow_clock(rig, lossy(record(wind))[0])))
    held_out, true_s = lossy(record(wind, "held_out"), 0.05)
    retimed = retime_validation(FitContext(rig, {}, held_out, lambda: None), lost, held_out)

    assert np.abs(retimed.time_s - (true_s - true_s[0])).max() < 0.1
    assert np.abs(held_out.time_s - (true_s - true_s[0])).max() > 1.0
