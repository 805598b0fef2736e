"""Detection of samples that were lost without a gap in the time stamps, and their number before each sample.

Only the random walk of true time distinguishes them from a clock whose rate is wrong. Where a machine shakes the housing, the
phase of the vibration shows a lost sample where the swing alone does not.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import MachineLine, find_machine_line
from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.sensor_output import ClockDrift
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext, is_world_directed
from gateway.twin.reconcile.fit.least_squares import Fit, FitProblem
from gateway.twin.reconcile.fit.multiple_shooting import fit_model
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.validation import evaluate_on_validation
from gateway.twin.reconcile.timing.time_warp import (
    INITIAL_STATES,
    MIN_LOST_FRACTION,
    TimeWarp,
    estimate_time_warp,
    lowpass,
    noise_chi2_below_swing_frequencies,
    quantised_mean_of,
)
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, N_ROPE_STATES

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
COUNT_ITERATIONS = 4
"""Alternations between the path, the vibration and the initial state."""
SEARCH_SAMPLES = 12
"""Samples on either side of the estimated count among which the path is searched."""
MAX_CONSECUTIVE_LOSSES = 3
"""Largest number of samples lost in one place."""
MIN_EXPLAINED_SHARE = 0.8
"""Share of the residual of a constant rate that the walk must explain, in the band of swings, beyond the noise."""
NORMALISED_COST_RANGE = (0.65, 1.6)
"""Chi-square of the walk per effective step for lost samples, which follow the prior. A clock whose rate is wrong gives half of
it or less, a swing that itself changed twice or more."""


def viterbi_loss_count(simulator: Simulator, warp: TimeWarp, observations: Observations) -> TimeWarp:
    """Return the time warp in whole samples, by the most likely path (Viterbi 1967)."""
    o, interval_s = observations, observations.interval_s
    rows, positions = np.arange(len(o.time_s)), list(INITIAL_STATES)
    lost = np.maximum.accumulate(np.round(warp.true_s / interval_s - rows)).astype(np.int64)
    values, fraction = warp.values.copy(), warp.fraction
    true_s: Array = warp.true_s
    line: MachineLine | None = None
    for iteration in range(COUNT_ITERATIONS):
        if iteration:
            true_s = np.asarray((rows + lost) * interval_s, dtype=np.float64)
            linear = simulator.linearise(values, true_s, o.temperature_c)
            by_state = (linear.jacobian[:, :, positions] * o.per_sigma[:, :, None]).reshape(-1, len(positions))
            residual = o.residual_sigma(linear.force_g + _vibration_g(line, true_s)).ravel()
            values[positions] += np.linalg.lstsq(by_state, residual, rcond=None)[0]
        line = find_machine_line(true_s, o.force_g - simulator.predict(values, true_s, o.temperature_c), o.noise_g)
        grid_s = np.arange(lost[-1] + len(rows) + SEARCH_SAMPLES + 1) * interval_s
        force_g = simulator.predict(values, grid_s) + _vibration_g(line, grid_s)
        lost = _most_likely_path(o, force_g, lost, max(fraction, MIN_LOST_FRACTION))
        fraction = float(lost[-1] / (lost[-1] + len(rows)))
    true_s = np.asarray((rows + lost) * interval_s, dtype=np.float64)
    force_g = simulator.predict(values, true_s, o.temperature_c) + _vibration_g(line, true_s)
    return replace(warp, true_s=true_s, fraction=fraction, reduced=o.reduced_chi2(force_g), values=values)


def _most_likely_path(observations: Observations, force_g: Array, near: Counts, fraction: float) -> Counts:
    """Return the number of samples lost before each, within `SEARCH_SAMPLES` of an estimate (n,).

    `force_g` is the simulation at all samples, lost ones included, on an even grid.
    """
    o = observations
    offsets = np.arange(-SEARCH_SAMPLES, SEARCH_SAMPLES + 1)
    losses = np.arange(MAX_CONSECUTIVE_LOSSES + 1)
    step_cost = -2 * np.log(np.where(losses == 0, 1 - fraction, fraction**losses))
    cost = np.where(near[0] + offsets == 0, 0.0, np.inf)
    best_losses = np.zeros((len(near), len(offsets)), dtype=np.int64)
    states = np.clip(np.arange(len(near))[:, None] + near[:, None] + offsets, 0, len(force_g) - 1)
    misfit = (((o.force_g[:, None] - force_g[states]) / o.noise_g) ** 2).sum(axis=2) * o.used[:, None]
    misfit[(near[:, None] + offsets) < 0] = np.inf
    for i in range(1, len(near)):
        # State s now was state s + shift - losses before: the search window moved by `shift`.
        shift = int(near[i] - near[i - 1])
        pad = np.full(MAX_CONSECUTIVE_LOSSES, np.inf), np.full(max(0, shift), np.inf)
        padded = np.concatenate([pad[0], cost, pad[1]])
        firsts = MAX_CONSECUTIVE_LOSSES + shift - losses
        tried = np.stack([padded[first : first + len(offsets)] for first in firsts]) + step_cost[:, None]
        best_losses[i] = np.argmin(tried, axis=0)
        cost = tried[best_losses[i], np.arange(len(offsets))] + misfit[i]
    state = int(np.argmin(cost))
    path = np.empty(len(near), dtype=np.int64)
    for i in range(len(near) - 1, -1, -1):
        path[i] = near[i] + offsets[state]
        if i:
            state = int(state + (near[i] - near[i - 1]) - best_losses[i, state])
    return path


def _vibration_g(line: MachineLine | None, true_s: Array) -> Array:
    if line is None:
        return np.zeros((len(true_s), 3))
    signal_g: Array = (line.phasors_g * np.exp(2j * np.pi * line.frequency_hz * true_s)[:, None]).real
    return signal_g


@dataclass(frozen=True, slots=True)
class ConstantRateFit:
    """A fit with a clock whose rate is wrong."""

    values: EffectValues
    fit: Fit

    @property
    def lost_fraction(self) -> float:
        """Fraction of the samples that would have to be lost."""
        return -float(np.asarray(self.values[ClockDrift.name]["relative"]))

    @property
    def others(self) -> EffectValues:
        """Effects other than the clock."""
        return {name: each for name, each in self.values.items() if name != ClockDrift.name}


@dataclass(frozen=True, slots=True)
class SampleLossFit:
    """A time warp, and the effects that were fitted with it."""

    time_warp: TimeWarp
    others: EffectValues
    evidence: float
    """BIC: chi-square of samples and walk, and the cost of the free values; lower is better."""

    @property
    def clock(self) -> EffectValues:
        """The clock whose rate is wrong by as much on average."""
        return {ClockDrift.name: {"relative": -self.time_warp.fraction}}


def find_sample_loss(context: FitContext, clock_fits: Iterable[CandidateFit]) -> SampleLossFit | None:
    """Return the time warp with the most evidence where the log, fitted with a clock error, shows one; else None."""
    alone = [each for each in clock_fits if all(EFFECTS[name].structure is ModelStructure.ROPE for name in each.names)]
    found = (_find_in(context, ConstantRateFit(each.values, each.fit)) for each in alone)
    return min(filter(None, found), key=lambda loss: loss.evidence, default=None)


def _find_in(context: FitContext, constant_rate: ConstantRateFit) -> SampleLossFit | None:
    loss = _fit_time_warp(context, constant_rate)
    if loss is None or not _is_sample_loss(context, constant_rate, loss):
        return None
    return _count_lost_samples(context, loss)


def retime_validation(context: FitContext, loss: SampleLossFit, held_out: Observations) -> Observations:
    """Return the held-out recording at its own true times; unchanged where no samples are found to be lost in it."""
    model_effects = {**context.model_effects, **loss.others}
    initial = evaluate_on_validation(context.rig, {**model_effects, **loss.clock}, held_out).fit
    simulator = Simulator(context.rig, sorted({**model_effects, **loss.clock}))
    free = np.array([each.refitted or each.effect == ClockDrift.name for each in simulator.parameters])
    free[HEADING] = is_world_directed(model_effects)
    state, effect_values = initial.values[None, :N_ROPE_STATES], initial.values[N_ROPE_STATES:]
    fit = fit_model(FitProblem(simulator, held_out, free), state, effect_values)
    clock = {ClockDrift.name: simulator.effects(fit.values)[ClockDrift.name]}
    held_out_context = replace(context, log=held_out, model_effects=model_effects)
    held_out_loss = _find_in(held_out_context, ConstantRateFit(clock, fit))
    return held_out if held_out_loss is None else held_out_loss.time_warp.retimed(held_out)


def _fit_time_warp(context: FitContext, constant_rate: ConstantRateFit) -> SampleLossFit | None:
    """Return a time warp fitted with the effects of a hypothesis; None where a constant rate explains the log as well."""
    if constant_rate.lost_fraction < MIN_LOST_FRACTION:
        return None
    log, simulator = context.log, context.simulator(tuple(constant_rate.others))
    initial_state = constant_rate.fit.values[:N_ROPE_STATES]
    values = simulator.values(initial_state, {**context.model_effects, **constant_rate.others})
    free = [*INITIAL_STATES, *_free_parameter_indices(simulator, constant_rate.others)]
    try:
        warp = estimate_time_warp(simulator, values, log, constant_rate.lost_fraction, free)
    except INTEGRATION_FAILURES:
        return None
    if warp is None or not warp.reduced * log.n_values <= constant_rate.fit.chi2:
        return None
    effects = simulator.effects(warp.values)
    evidence = warp.reduced * log.n_values + warp.cost + len(free) * math.log(log.n_values)
    return SampleLossFit(warp, {name: effects[name] for name in constant_rate.others}, evidence)


def _free_parameter_indices(simulator: Simulator, effects: Iterable[str]) -> list[int]:
    """Return the positions of these effects' values, without those on which a time warp has no influence.

    They show in the samples or their spectrum, outside the band of the swing.
    """
    names = {name for name in effects if not (EFFECTS[name].detected_in_samples or EFFECTS[name].found_before_search)}
    return [i for i, each in enumerate(simulator.parameters) if each.effect in names and not each.is_event_time]


def _is_sample_loss(context: FitContext, constant_rate: ConstantRateFit, loss: SampleLossFit) -> bool:
    """Return whether the walk has the variance of lost samples, and explains the residual of a constant rate."""
    log, warp, simulator = context.log, loss.time_warp, context.simulator(tuple(loss.others))
    interval_s = log.interval_s
    simulated_g = simulator.predict(warp.values, warp.true_s, log.temperature_c)

    def chi2(force_g: Array) -> float:
        mean_g = quantised_mean_of(simulator, warp.values, force_g)
        return float((lowpass(log.residual_sigma(mean_g), interval_s) ** 2).sum())

    noise = noise_chi2_below_swing_frequencies(simulator, warp.values, simulated_g, log)
    before, after = chi2(constant_rate.fit.force_g) - noise, chi2(simulated_g) - noise
    is_random_walk = NORMALISED_COST_RANGE[0] < warp.normalised_cost < NORMALISED_COST_RANGE[1]
    return is_random_walk and after < (1 - MIN_EXPLAINED_SHARE) * before and warp.fraction > MIN_LOST_FRACTION


def _count_lost_samples(context: FitContext, loss: SampleLossFit) -> SampleLossFit:
    """Return the time warp in whole samples, where a machine's vibration determines them."""
    log, warp, simulator = context.log, loss.time_warp, context.simulator(tuple(loss.others))
    simulated_g = simulator.predict(warp.values, warp.true_s, log.temperature_c)
    residual_g = log.force_g - quantised_mean_of(simulator, warp.values, simulated_g)
    if find_machine_line(warp.true_s, residual_g, log.noise_g) is None:
        return loss
    return replace(loss, time_warp=viterbi_loss_count(simulator, warp, log))
