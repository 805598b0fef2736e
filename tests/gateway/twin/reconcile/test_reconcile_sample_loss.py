"""Samples lost without a gap in the time stamps, alone and with other effects."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.twin.effects.parameter import Value
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.sensor import noise_with_quantisation_g
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.sample_loss import SampleLossFit, find_sample_loss, retime_validation
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import Budget, make_context
from gateway.twin.reconcile.search.steps import fit_clock_hypotheses

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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("viscous_damping", {"damping_ratio": 0.004}),
        ("axis_offset", {"offset_g": (0.012, -0.008, 0.006)}),
        ("lowpass_lag", {"cutoff_hz": 0.5}),
    ],
)
def test_lost_samples_are_found_beside_another_effect(
    rig: TwinRig, record: Record, name: str, parameters: dict[str, Value]
) -> None:
    lossy, true_s = lose_samples(record({name: parameters}))
    loss = find_in(rig, lossy)

    assert loss is not None
    assert loss.fraction == pytest.approx(1 - len(true_s) / 1200, abs=0.004)
    assert np.abs(loss.true_s - (true_s - true_s[0])).max() < 0.1  # two samples
    assert loss.others.keys() <= {name}


@pytest.mark.slow
def test_no_further_effect_is_found_with_lost_samples_alone(rig: TwinRig, record: Record) -> None:
    loss = find_in(rig, lose_samples(record({}))[0])

    assert loss is not None
    assert loss.others == {}


@pytest.mark.slow
def test_slow_clock_is_not_taken_for_lost_samples(rig: TwinRig, record: Record) -> None:
    observations = record({"clock_drift": {"relative": -FRACTION}, "viscous_damping": {"damping_ratio": 0.004}})

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
    assert np.abs(loss.true_s - (true_s - true_s[0])).max() < 0.1


@pytest.mark.slow
def test_validation_recording_has_losses_and_a_heading_of_its_own(rig: TwinRig, record: Record) -> None:
    wind: EffectValues = {"steady_wind": {"accel_m_s2": (0.3, -0.2)}}
    loss = find_in(rig, lose_samples(record(wind))[0])
    assert loss is not None
    held_out, true_s = lose_samples(record(wind, "held_out"), 0.05)
    retimed = retime_validation(FitContext(rig, {}, held_out, lambda: None), loss, held_out)

    assert np.abs(retimed.time_s - (true_s - true_s[0])).max() < 0.1
    assert np.abs(held_out.time_s - (true_s - true_s[0])).max() > 1.0
