"""Conditional score test: further effects in a recording with lost samples, with the time warp free.

As the score test (Rao 1948), but with the time warp marginalised under its prior, and its mean slope free. Neither then hides the
other.
"""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.reparameterisation import reparameterise
from gateway.twin.reconcile.residual import noise_inflation_factor
from gateway.twin.reconcile.search.candidates import MIN_SCORE_STATISTIC, MIN_VARIANCE_SHARE
from gateway.twin.reconcile.search.signatures import scorable_effects
from gateway.twin.reconcile.timing.time_warp import (
    INITIAL_STATES,
    TimeWarpSmoother,
    linearise_in_time,
    lowpass,
    make_knots,
    marginalise_time_warp,
    quantised_mean_of,
    step_variance,
)
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
MAX_ADDITIONAL_EFFECTS = 3
"""Largest number of effects fitted with a time warp, and of rivals for each of them."""
MIN_SHARE_OF_BEST = 0.7
"""Predicted decrease of chi-square, relative to the best effect's, from which a linearisation does not decide between two."""


def score_additional_effects(
    context: FitContext, others: EffectValues, initial_state: Array, true_s: Array, fraction: float
) -> list[str]:
    """Return the persistent effect with the largest score at true times (n,) and its rivals; empty if none is significant.

    `others` are in the model, `initial_state` is that of a fit with them.
    """
    log, values = context.log, {**context.model_effects, **others}
    excluded = {*others, *context.model_effects}
    tried = [name for name in scorable_effects(context) if name not in excluded and not _resembles_warp(name)]
    simulator = context.simulator((*others, *tried))
    model, all_values = (
        reparameterise(simulator, np.ones(len(simulator.parameters), bool)),
        simulator.values([], values),
    )
    n_states = simulator.n_initial_states
    fitted = np.concatenate([initial_state, model.to_fitted(all_values[n_states:])])
    linear = linearise_in_time(model, fitted, log, true_s)
    by_slope = (linear.by_time * true_s[:, None])[:, :, None]
    by_values = np.concatenate([linear.by_values, by_slope], axis=2)
    knots, interval_s = make_knots(len(log.time_s)), log.interval_s
    residual = lowpass(log.residual_sigma(_simulate(context, others, initial_state, true_s)), interval_s)
    smoother = marginalise_time_warp(
        residual, linear.by_time, by_values, np.zeros(knots.count), knots, step_variance(fraction, interval_s)
    )
    nuisance = [*INITIAL_STATES, *free_parameter_indices(simulator, others), by_values.shape[2] - 1]
    positions = {name: free_parameter_indices(simulator, [name]) for name in tried}
    drops = {name: _predicted_chi2_drop(smoother, simulator, nuisance, positions[name]) for name in tried}
    ranked = sorted(drops, key=lambda name: -drops[name])
    best = ranked[0]
    chosen = [*nuisance, *positions[best]]
    step, _ = smoother.solve(chosen)
    explained_by_warp = linear.by_time * knots.at_samples(smoother.warp(chosen, step))[:, None]
    inflation = noise_inflation_factor(log.time_s, residual - explained_by_warp - by_values[:, :, chosen] @ step)
    significant = MIN_SCORE_STATISTIC + len(positions[best]) * math.log(log.n_values)
    if drops[best] < max(significant, MIN_VARIANCE_SHARE * log.n_values / inflation) * inflation:
        return []
    return [name for name in ranked[:MAX_ADDITIONAL_EFFECTS] if drops[name] > MIN_SHARE_OF_BEST * drops[best]]


def _simulate(context: FitContext, others: EffectValues, initial_state: Array, true_s: Array) -> Array:
    """Return the mean readings of the model and `others` at true times, shape (n, 3)."""
    simulator = context.simulator(tuple(others))
    values = simulator.values(initial_state, {**context.model_effects, **others})
    return quantised_mean_of(simulator, values, simulator.predict(values, true_s, context.log.temperature_c))


def free_parameter_indices(simulator: Simulator, effects: Iterable[str]) -> list[int]:
    """Return the positions of these effects' values, without those on which a time warp has no influence."""
    names = set(effects)
    return [
        i
        for i, parameter in enumerate(simulator.parameters)
        if parameter.effect in names and not _is_visible_in_samples(parameter.effect) and not parameter.is_event_time
    ]


def _is_visible_in_samples(name: str) -> bool:
    """Return whether an effect shows in the samples or their spectrum, outside the band of the swing."""
    effect = EFFECTS[name]
    return effect.detected_in_samples or effect.found_before_search


def _resembles_warp(name: str) -> bool:
    """Return whether an effect changes the period, as a time warp with a mean slope does."""
    return EFFECTS[name].scales_period or EFFECTS[name].length_like


def _predicted_chi2_drop(
    smoother: TimeWarpSmoother, simulator: Simulator, nuisance: list[int], positions: list[int]
) -> float:
    """Return the decrease of chi-square by an effect beside the nuisance values; 0 where its only parameter would be negative."""
    step, drop = smoother.solve([*nuisance, *positions])
    is_one_sided = len(positions) == 1 and simulator.parameters[positions[0]].lower == 0
    if is_one_sided and step[-1] < 0:
        return 0.0
    return drop - smoother.solve(nuisance)[1]
