"""Causes that every rig has to some degree: fitted together, told apart, named beside a remainder."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.least_squares import prior_of_parts
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.text import to_text
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.ambiguity import leaves_no_more, necessary_names
from gateway.twin.reconcile.search.candidates import make_candidate
from gateway.twin.simulator.simulator import Simulator

OF_A_REAL_RIG: EffectValues = {
    "viscous_damping": {"damping_ratio": 0.008},
    "axis_offset": {"offset_g": (0.02, -0.015, 0.01)},
    "housing_position": {"error_m": 0.3},
    "lever_arm": {"offset_m": (0.04, 0.0)},
}
"""Four causes: a search of three effects ends before them."""


def with_remainder(checked: CheckedRecording, amplitude_g: float) -> CheckedRecording:
    """Add what no effect describes: a line along the rope whose frequency wanders."""
    observations = checked.observations
    assert observations is not None
    time_s = observations.time_s
    force_g = observations.force_g.copy()
    force_g[:, 2] += amplitude_g * np.sin(2 * np.pi * (1.3 * time_s + 2.0 * np.sin(0.35 * time_s)))
    return replace(checked, observations=replace(observations, force_g=force_g))


def known(found: Reconciliation) -> set[str]:
    return {*(effect.name for effect in found.effects), *found.candidates, *(n for g in found.also_one_of for n in g)}


def test_losses_and_errors_of_the_rig_are_usual_and_the_wind_is_not() -> None:
    usual = set(EFFECTS.choose(is_usual=True))

    assert {"viscous_damping", "axis_offset", "mount_misalignment", "rope_length"} <= usual
    assert not usual & {"steady_wind", "impact", "housing_spin", "double_pendulum", "clock_drift"}


@pytest.mark.slow
def test_prior_of_parts_holds_a_sum_that_a_small_swing_does_not_determine(
    model: Model, record: Callable[..., Observations]
) -> None:
    """Along the rope a small swing reads nearly 1 g, so that an offset and a scale error of z are one number, 0.021 g."""
    log = record({"axis_offset": {"offset_g": (0.0, 0.0, 0.021)}})
    setting = FitContext(model.rig, {}, log, lambda: None)
    values: EffectValues = {"axis_offset": {}, "scale_error": {}}
    fit = setting.fit(values, held_by_parts=True)
    found = setting.simulator(tuple(values)).effects(fit.values)
    offset_g, scale = (
        np.array(found[name][key])[2] for name, key in (("axis_offset", "offset_g"), ("scale_error", "relative"))
    )

    assert offset_g + scale == pytest.approx(0.021, abs=2e-4)
    # The least sum of squares in standard deviations of the prior, 0.06 g and 0.03, divides it as their squares, 4 to 1.
    assert offset_g == pytest.approx(0.8 * 0.021, abs=5e-3)
    assert fit.chi2 < 1.05 * log.n_values


def test_prior_of_parts_is_that_of_their_limits(model: Model) -> None:
    simulator = Simulator(model.rig, ["axis_offset", "viscous_damping"])
    prior = prior_of_parts(simulator)
    precision = {spec.label: p for spec, p in zip(simulator.parameters, prior.precision, strict=True)}

    assert precision["axis_offset.offset_g[x]"] == pytest.approx(0.06**-2)
    assert precision["viscous_damping.damping_ratio"] == 0
    assert prior.chi2(prior.centre) == 0


@pytest.mark.slow
def test_only_causes_that_the_recording_needs_are_kept(model: Model, record: Callable[..., Observations]) -> None:
    hidden: EffectValues = {name: OF_A_REAL_RIG[name] for name in ("viscous_damping", "axis_offset")}
    setting = FitContext(model.rig, {}, record(hidden), lambda: None)
    values: EffectValues = {name: {} for name in ("viscous_damping", "axis_offset", "lever_arm", "quadratic_drag")}
    found = make_candidate(setting, values, setting.fit(values, held_by_parts=True))

    assert found is not None
    assert necessary_names(found, setting.simulator(tuple(values)), setting.log) == {"viscous_damping", "axis_offset"}


def test_a_best_attempt_below_the_noise_bars_no_usual_causes() -> None:
    assert leaves_no_more(0.95, 0.94)
    assert leaves_no_more(6.88, 6.80)
    assert not leaves_no_more(9.0, 6.80)
    assert not leaves_no_more(1.2, 0.94)


@pytest.mark.slow
def test_usual_causes_are_named_beside_a_remainder(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    log, held_out = (with_remainder(loaded(OF_A_REAL_RIG, name), 1.5e-3) for name in ("log", "held_out"))
    found = reconcile(model, log, held_out)

    assert found.verdict in ("named_with_remainder", "one_of")
    assert {"viscous_damping", "axis_offset"} <= known(found)
    assert known(found) <= {*EFFECTS.choose(is_usual=True), "steady_wind", "cross_axis", "housing_rocking"}
    assert "without each of them far more is left" in to_text(found)


@pytest.mark.slow
def test_usual_causes_do_not_imitate_what_is_unknown(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    log, held_out = (with_remainder(loaded({}, name), 4e-3) for name in ("log", "held_out"))
    found = reconcile(model, log, held_out)

    assert found.verdict == "unmodelled"
    assert not known(found)
