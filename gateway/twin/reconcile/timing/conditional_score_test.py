"""What else acts where time wanders: a score test that leaves the walk free, so that neither hides the other.

Rao 1948, as in `score.py`; the walk is put in by its own spread, and so is its mean drift.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.residual.noise_inflation import noise_inflation_factor
from gateway.twin.reconcile.search.candidates import MIN_SCORE_STATISTIC, MIN_VARIANCE_SHARE, Values
from gateway.twin.reconcile.search.score_test import scorable_effects
from gateway.twin.reconcile.timing.time_warp_smoother import TimeWarpSmoother, make_knots, marginalise_time_warp
from gateway.twin.reconcile.timing.timing_jitter import (
    INITIAL_MOTION,
    linearise_at,
    lowpass,
    quantised_mean_of,
    step_variance,
)
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
MAX_TIED_EFFECTS, TIED_SHARE = 3, 0.7
"""Effects of which a linear look cannot tell which it is: so many at most, with this share of what the best takes off."""


def score_additional_effects(
    setting: FitContext, others: Values, start: Array, true_s: Array, fraction: float
) -> list[str]:
    """The lasting effect that takes most off, beside the others at these times, and its rivals; none where none is worth a name.

    `start` is the motion's under the others.
    """
    o, own = setting.log, setting.simulator(tuple(others))
    tried = [
        name
        for name in scorable_effects(setting)
        if name not in {*others, *setting.model_effects} and not _is_period_like(name)
    ]
    simulator = setting.simulator((*others, *tried))
    at = simulator.values(start, {**setting.model_effects, **others})
    _, by_time, by_values = linearise_at(simulator, at, o, true_s)
    by_values = np.concatenate([by_values, (by_time * true_s[:, None])[:, :, None]], axis=2)
    values = own.values(start, {**setting.model_effects, **others})
    left_g = quantised_mean_of(own, values, own.predict(values, true_s, o.temperature_c))
    knots, dt = make_knots(len(o.time_s)), float(np.median(np.diff(o.time_s)))
    residual = lowpass(o.residual_sigma(left_g), dt)
    equations = marginalise_time_warp(
        residual, by_time, by_values, np.zeros(knots.count), knots, step_variance(fraction, dt)
    )
    fixed = [*INITIAL_MOTION, *free_parameter_indices(simulator, others), by_values.shape[2] - 1]
    places = {name: free_parameter_indices(simulator, {name: {}}) for name in tried}
    drops = {name: _predicted_chi2_drop(equations, simulator, fixed, places[name]) for name in tried}
    ranked = sorted(drops, key=lambda name: -drops[name])
    best = ranked[0]
    step, _ = equations.solve(chosen := [*fixed, *places[best]])
    walked = by_time * knots.at_samples(equations.walk(chosen, step))[:, None]
    unit = noise_inflation_factor(o.time_s, residual - walked - by_values[:, :, chosen] @ step)
    if (
        drops[best]
        < max(MIN_SCORE_STATISTIC + len(places[best]) * math.log(o.n_values), MIN_VARIANCE_SHARE * o.n_values / unit)
        * unit
    ):
        return []
    return [name for name in ranked[:MAX_TIED_EFFECTS] if drops[name] > TIED_SHARE * drops[best]]


def free_parameter_indices(simulator: Simulator, others: Mapping[str, object]) -> list[int]:
    """Where the parameters of these stand among the simulator's values, but for those that a step of time does not change."""
    return [
        i
        for i, slot in enumerate(simulator.parameters)
        if slot.effect in others and not _is_visible_in_samples(slot.effect) and not slot.is_event_time
    ]


def _is_visible_in_samples(name: str) -> bool:
    """Whether an effect shows in the samples or their spectrum, outside the band of the swing."""
    effect = EFFECTS[name]
    return effect.detected_in_samples or effect.found_before_search


def _is_period_like(name: str) -> bool:
    """Whether an effect makes up for a wrong period, as timing jitter with a mean drift does."""
    return EFFECTS[name].scales_period or EFFECTS[name].length_like


def _predicted_chi2_drop(
    equations: TimeWarpSmoother, simulator: Simulator, fixed: list[int], places: list[int]
) -> float:
    """By how much chi-square falls beside what is fitted anyway; signs of one-sided parameters are kept."""
    step, drop = equations.solve([*fixed, *places])
    slot = simulator.parameters[places[0]]
    one_sided = len(places) == 1 and slot.lower == 0
    if one_sided and step[-1] < 0:
        return 0.0
    return drop - equations.solve(fixed)[1]
