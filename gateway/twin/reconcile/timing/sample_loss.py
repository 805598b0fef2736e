"""Were samples lost without a trace? Only a random walk of time tells that from a clock that runs slow."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import find_machine_line
from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.clock import ClockDrift
from gateway.twin.effects.sensor_output import LowpassLag
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext, is_world_directed
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.levenberg_marquardt import REFINEMENT_ITERATIONS
from gateway.twin.reconcile.fit.multiple_shooting import fit_model
from gateway.twin.reconcile.fit.validation import evaluate_on_validation
from gateway.twin.reconcile.residual.residual_tests import EXCESS_SIGNIFICANT
from gateway.twin.reconcile.search.candidates import CandidateFit, Values
from gateway.twin.reconcile.timing.conditional_score_test import free_parameter_indices, score_additional_effects
from gateway.twin.reconcile.timing.timing_jitter import (
    INITIAL_MOTION,
    TimeWarp,
    estimate_time_warp,
    lowpass,
    quantised_mean_of,
    simulate_noisy_sample,
    viterbi_loss_count,
)
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, N_ROPE_STATES

Array = NDArray[np.float64]
MIN_LOST_FRACTION = 0.002
MIN_EXPLAINED_SHARE = 0.8
"""Share of what a steady clock leaves below the machines' frequencies that the walk must take away."""
NORMALISED_COST_RANGE = (0.65, 1.6)
"""Cost of the walk for each of its steps that the readings tell: 1 for lost samples, by their own law; half of it and less for a
clock that is only slow, twice and more for a swing that itself changed."""
LAG = LowpassLag.name
"""A linear look says little of it: to first order it is a shift of time."""
MAX_ADDITIONAL_EFFECTS = 3
"""Effects that are looked for beside the walk."""


@dataclass(frozen=True, slots=True)
class ConstantRateFit:
    """A fit with a clock that runs slow."""

    values: Values
    fit: Fit

    @property
    def missing(self) -> float:
        """Part of the samples, were they lost."""
        return -float(np.asarray(self.values[ClockDrift.name]["relative"]))

    @property
    def others(self) -> Values:
        """Effects beside the clock."""
        return {name: each for name, each in self.values.items() if name != ClockDrift.name}


@dataclass(frozen=True, slots=True)
class SampleLossFit:
    """Time that wanders, and what acts beside it."""

    walk: TimeWarp
    others: Values
    evidence: float
    """Chi-square of readings and walk, and what the number of free values costs; lower is better."""


def find_sample_loss(setting: FitContext, slow_clock: CandidateFit) -> SampleLossFit | None:
    """The walk where the log, fitted with a clock that runs slow, shows one; None where nothing wanders.

    An effect that is not in the fit may hide the walk, as the walk may hide the effect: where a score test beside a free walk
    finds one, both are fitted together.
    """
    if ClockDrift.name not in slow_clock.values or any(
        EFFECTS[name].structure is not ModelStructure.ROPE for name in slow_clock.names
    ):
        return None
    steady, found = ConstantRateFit(slow_clock.values, slow_clock.fit), None
    if steady.missing < MIN_LOST_FRACTION:
        return None
    lost = _fit_time_warp(setting, steady)
    for _ in range(MAX_ADDITIONAL_EFFECTS):
        if lost is not None and not _is_sample_loss(setting, steady, lost):
            lost = None
        found = lost or found
        names = _additional_effects(setting, steady, lost)
        lost = _best_hypothesis(setting, steady, names)
        if lost is None:
            break
        clock: Values = {ClockDrift.name: {"relative": -lost.walk.fraction}}
        steady = _fit_constant_rate(setting, {**lost.others, **clock}, lost.walk.values)
    if lost is not None and _is_sample_loss(setting, steady, lost):
        found = lost
    return None if found is None else _count_lost(setting, found)


def _best_hypothesis(setting: FitContext, steady: ConstantRateFit, names: list[str]) -> SampleLossFit | None:
    """The walk beside one more effect that leaves least; a lag is tried, too, where none of them explains all."""
    walks = [
        walk for name in names if (walk := _fit_time_warp(setting, _with_effect(setting, steady, name))) is not None
    ]
    if (
        walks
        and LAG not in {*names, *steady.values}
        and min(walk.walk.reduced for walk in walks) > 1 + EXCESS_SIGNIFICANT
    ):
        lagging = _fit_time_warp(setting, _with_effect(setting, steady, LAG))
        walks += [] if lagging is None else [lagging]
    return min(walks, key=lambda each: each.evidence, default=None)


def _additional_effects(setting: FitContext, steady: ConstantRateFit, lost: SampleLossFit | None) -> list[str]:
    """What else may act, where time wanders as found; from the steady clock where no walk is believed."""
    if lost is not None:
        return score_additional_effects(
            setting, lost.others, lost.walk.values[:N_ROPE_STATES], lost.walk.true_s, lost.walk.fraction
        )
    true_s = setting.log.time_s / (1 - steady.missing)
    return score_additional_effects(setting, steady.others, steady.fit.values[:N_ROPE_STATES], true_s, steady.missing)


def _with_effect(setting: FitContext, steady: ConstantRateFit, name: str) -> ConstantRateFit:
    """One more effect, at rest; a lag first with the steady clock, since the readings do not follow it in proportion."""
    values: Values = {**steady.values, name: EFFECTS[name].default_guess}
    try:
        return (
            _constant_rate_fit(setting, values, setting.fit(values))
            if name == LAG
            else ConstantRateFit(values, steady.fit)
        )
    except INTEGRATION_FAILURES:
        return ConstantRateFit(values, steady.fit)


def _fit_constant_rate(setting: FitContext, values: Values, start: Array) -> ConstantRateFit:
    """Fitted from here, as one motion."""
    simulator = setting.simulator(tuple(values))
    at = simulator.values(start[:N_ROPE_STATES], {**setting.model_effects, **values})
    free = setting.free_parameters(simulator, values)
    fit = fit_model(
        simulator,
        setting.log,
        at[None, :N_ROPE_STATES],
        at[N_ROPE_STATES:],
        free,
        [0],
        REFINEMENT_ITERATIONS,
        setting.tick,
    )
    return _constant_rate_fit(setting, values, fit)


def _constant_rate_fit(setting: FitContext, values: Values, fit: Fit) -> ConstantRateFit:
    model = setting.simulator(tuple(values)).effects(fit.values)
    return ConstantRateFit({name: model[name] for name in values}, fit)


def _fit_time_warp(setting: FitContext, steady: ConstantRateFit) -> SampleLossFit | None:
    """Beside effects that are fitted with it; None where no clock runs slow, or one that runs straight leaves less."""
    if steady.missing < MIN_LOST_FRACTION:
        return None
    o, simulator = setting.log, setting.simulator(tuple(steady.others))
    values = simulator.values(steady.fit.values[:N_ROPE_STATES], {**setting.model_effects, **steady.others})
    free = [*INITIAL_MOTION, *free_parameter_indices(simulator, steady.others)]
    try:
        walk = estimate_time_warp(simulator, values, o, steady.missing, free)
    except INTEGRATION_FAILURES:
        return None  # it ran to parameters that no integration can follow
    if walk is None or not walk.reduced * o.n_values <= steady.fit.chi2:
        return None
    model = simulator.effects(walk.values)
    evidence = walk.reduced * o.n_values + walk.cost + len(free) * math.log(o.n_values)
    return SampleLossFit(walk, {name: model[name] for name in steady.others}, evidence)


def _is_sample_loss(setting: FitContext, steady: ConstantRateFit, lost: SampleLossFit) -> bool:
    """Samples lost at random make such a walk, and it takes away what a steady clock leaves."""
    o, walk, simulator = setting.log, lost.walk, setting.simulator(tuple(lost.others))
    dt = float(np.median(np.diff(o.time_s)))
    simulated_g = simulator.predict(walk.values, walk.true_s, o.temperature_c)
    after_g, before_g = (quantised_mean_of(simulator, walk.values, each) for each in (simulated_g, steady.fit.force_g))
    noise_g = simulate_noisy_sample(simulator, walk.values, simulated_g) - after_g
    left, was, noise = (
        (lowpass(each, dt) ** 2).sum()
        for each in (o.residual_sigma(after_g), o.residual_sigma(before_g), noise_g / o.noise_g)
    )
    wanders = NORMALISED_COST_RANGE[0] < walk.normalised_cost < NORMALISED_COST_RANGE[1]
    return bool(
        wanders and left - noise < (1 - MIN_EXPLAINED_SHARE) * (was - noise) and walk.fraction > MIN_LOST_FRACTION
    )


def _count_lost(setting: FitContext, lost: SampleLossFit) -> SampleLossFit:
    """In whole samples, where a machine's line tells them."""
    o, walk, simulator = setting.log, lost.walk, setting.simulator(tuple(lost.others))
    after_g = quantised_mean_of(simulator, walk.values, simulator.predict(walk.values, walk.true_s, o.temperature_c))
    line = find_machine_line(walk.true_s, o.force_g - after_g, o.noise_g)
    return lost if line is None else replace(lost, walk=viterbi_loss_count(simulator, walk, o))


def retime_validation(setting: FitContext, lost: SampleLossFit, held_out: Observations) -> Observations:
    """The held-out recording at its own true times, for judging what else is missing; as stamped where none are found."""
    clock: Values = {ClockDrift.name: {"relative": -lost.walk.fraction}}
    known = {**setting.model_effects, **lost.others, **clock}
    begun = evaluate_on_validation(setting.rig, known, held_out).fit
    simulator = Simulator(setting.rig, sorted(known))
    free = np.array([slot.refitted or slot.effect == ClockDrift.name for slot in simulator.parameters])
    free[HEADING] = is_world_directed(known)
    fit = fit_model(simulator, held_out, begun.values[None, :N_ROPE_STATES], begun.values[N_ROPE_STATES:], free, [0])
    clock = {ClockDrift.name: simulator.effects(fit.values)[ClockDrift.name]}
    there, steady = (
        replace(setting, log=held_out, model_effects={**setting.model_effects, **lost.others}),
        ConstantRateFit(clock, fit),
    )
    own = _fit_time_warp(there, steady)
    if own is None or not _is_sample_loss(there, steady, own):
        return held_out
    return _count_lost(there, own).walk.retimed(held_out)
