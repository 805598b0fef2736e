"""Were samples lost without a trace? Only a random walk of time tells that from a clock that runs slow."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import DIRECTED, Setting
from gateway.twin.reconcile.fit.multiple_shooting import HEADING, Fit, fit_model
from gateway.twin.reconcile.fit.validation import judge
from gateway.twin.reconcile.residual.residual_tests import OPEN
from gateway.twin.reconcile.residual.spectrum import machine_line
from gateway.twin.reconcile.search.candidate_fits import Attempt, Values
from gateway.twin.reconcile.search.initial_guesses import first_values
from gateway.twin.reconcile.timing.conditional_score_test import companions, free_places
from gateway.twin.reconcile.timing.timing_jitter import MOTION, Walk, as_read, counted, find_walk, one_reading, slow
from gateway.twin.simulator.compiled_model import UNFOLLOWED
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
LEAST_FRACTION = 0.002
CLOSED = 0.8
"""Share of what a steady clock leaves below the machines' frequencies that the walk must take away."""
WANDERS = (0.65, 1.6)
"""Cost of the walk for each of its steps that the readings tell: 1 for lost samples, by their own law; half of it and less for a
clock that is only slow, twice and more for a swing that itself changed."""
LAG = "lowpass_lag"
"""A linear look says little of it: to first order it is a shift of time."""
MOST_BESIDE = 3
"""Effects that are looked for beside the walk."""
STEADY_ROUNDS = 3
START = 5
"""Coordinates of a start."""


@dataclass(frozen=True, slots=True)
class Steady:
    """A fit with a clock that runs slow."""

    values: Values
    fit: Fit

    @property
    def missing(self) -> float:
        """Part of the samples, were they lost."""
        return -float(np.asarray(self.values["clock_drift"]["relative"]))

    @property
    def others(self) -> Values:
        """Effects beside the clock."""
        return {name: each for name, each in self.values.items() if name != "clock_drift"}


@dataclass(frozen=True, slots=True)
class Lost:
    """Time that wanders, and what acts beside it."""

    walk: Walk
    others: Values
    evidence: float
    """Chi-square of readings and walk, and what the number of free values costs; lower is better."""


def lost_samples(setting: Setting, slow_clock: Attempt) -> Lost | None:
    """The walk where the log, fitted with a clock that runs slow, shows one; None where nothing wanders.

    An effect that is not in the fit may hide the walk, as the walk may hide the effect: where a score test beside a free walk
    finds one, both are fitted together.
    """
    if "clock_drift" not in slow_clock.values or {"double_pendulum", "rope_stretch"} & slow_clock.names:
        return None
    steady, found = Steady(slow_clock.values, slow_clock.fit), None
    if steady.missing < LEAST_FRACTION:
        return None
    lost = _walk(setting, steady)
    for _ in range(MOST_BESIDE):
        if lost is not None and not _believed(setting, steady, lost):
            lost = None
        found = lost or found
        names = _beside(setting, steady, lost)
        lost = _likeliest(setting, steady, names)
        if lost is None:
            break
        clock: Values = {"clock_drift": {"relative": -lost.walk.fraction}}
        steady = _steady(setting, {**lost.others, **clock}, lost.walk.values)
    if lost is not None and _believed(setting, steady, lost):
        found = lost
    return None if found is None else _counted(setting, found)


def _likeliest(setting: Setting, steady: Steady, names: list[str]) -> Lost | None:
    """The walk beside one more effect that leaves least; a lag is tried, too, where none of them explains all."""
    walks = [walk for name in names if (walk := _walk(setting, _with(setting, steady, name))) is not None]
    if walks and LAG not in {*names, *steady.values} and min(walk.walk.reduced for walk in walks) > 1 + OPEN:
        lagging = _walk(setting, _with(setting, steady, LAG))
        walks += [] if lagging is None else [lagging]
    return min(walks, key=lambda each: each.evidence, default=None)


def _beside(setting: Setting, steady: Steady, lost: Lost | None) -> list[str]:
    """What else may act, where time wanders as found; from the steady clock where no walk is believed."""
    if lost is not None:
        return companions(setting, lost.others, lost.walk.values[:START], lost.walk.true_s, lost.walk.fraction)
    true_s = setting.log.time_s / (1 - steady.missing)
    return companions(setting, steady.others, steady.fit.values[:START], true_s, steady.missing)


def _with(setting: Setting, steady: Steady, name: str) -> Steady:
    """One more effect, at rest; a lag first with the steady clock, since the readings do not follow it in proportion."""
    values: Values = {**steady.values, name: first_values(name)}
    try:
        return _as_fitted(setting, values, setting.fit(values)) if name == LAG else Steady(values, steady.fit)
    except UNFOLLOWED:
        return Steady(values, steady.fit)


def _steady(setting: Setting, values: Values, start: Array) -> Steady:
    """Fitted from here, as one motion."""
    simulator = setting.simulator(tuple(values))
    at = simulator.values(start[:START], {**setting.believed, **values})
    free = setting.free(simulator, values)
    fit = fit_model(simulator, setting.log, at[None, :START], at[START:], free, [0], STEADY_ROUNDS, setting.tick)
    return _as_fitted(setting, values, fit)


def _as_fitted(setting: Setting, values: Values, fit: Fit) -> Steady:
    model = setting.simulator(tuple(values)).effects(fit.values)
    return Steady({name: model[name] for name in values}, fit)


def _walk(setting: Setting, steady: Steady) -> Lost | None:
    """Beside effects that are fitted with it; None where no clock runs slow, or one that runs straight leaves less."""
    if steady.missing < LEAST_FRACTION:
        return None
    o, simulator = setting.log, setting.simulator(tuple(steady.others))
    values = simulator.values(steady.fit.values[:START], {**setting.believed, **steady.others})
    free = [*MOTION, *free_places(simulator, steady.others)]
    try:
        walk = find_walk(simulator, values, o, steady.missing, free)
    except UNFOLLOWED:
        return None  # it ran to parameters that no integration can follow
    if walk is None or not walk.reduced * o.count <= steady.fit.chi2:
        return None
    model = simulator.effects(walk.values)
    evidence = walk.reduced * o.count + walk.cost + len(free) * math.log(o.count)
    return Lost(walk, {name: model[name] for name in steady.others}, evidence)


def _believed(setting: Setting, steady: Steady, lost: Lost) -> bool:
    """Samples lost at random make such a walk, and it takes away what a steady clock leaves."""
    o, walk, simulator = setting.log, lost.walk, setting.simulator(tuple(lost.others))
    dt = float(np.median(np.diff(o.time_s)))
    simulated_g = simulator.predict(walk.values, walk.true_s, o.temperature_c)
    after_g, before_g = (as_read(simulator, walk.values, each) for each in (simulated_g, steady.fit.force_g))
    noise_g = one_reading(simulator, walk.values, simulated_g) - after_g
    left, was, noise = (
        (slow(each, dt) ** 2).sum()
        for each in (o.residual_sigma(after_g), o.residual_sigma(before_g), noise_g / o.noise_g)
    )
    wanders = WANDERS[0] < walk.wander < WANDERS[1]
    return bool(wanders and left - noise < (1 - CLOSED) * (was - noise) and walk.fraction > LEAST_FRACTION)


def _counted(setting: Setting, lost: Lost) -> Lost:
    """In whole samples, where a machine's line tells them."""
    o, walk, simulator = setting.log, lost.walk, setting.simulator(tuple(lost.others))
    after_g = as_read(simulator, walk.values, simulator.predict(walk.values, walk.true_s, o.temperature_c))
    line = machine_line(walk.true_s, o.force_g - after_g, o.noise_g)
    return lost if line is None else replace(lost, walk=counted(simulator, walk, o))


def retimed_held_out(setting: Setting, lost: Lost, held_out: Observations) -> Observations:
    """The held-out recording at its own true times, for judging what else is missing; as stamped where none are found."""
    clock: Values = {"clock_drift": {"relative": -lost.walk.fraction}}
    known = {**setting.believed, **lost.others, **clock}
    begun = judge(setting.rig, known, held_out).fit
    simulator = Simulator(setting.rig, sorted(known))
    free = np.array([slot.refitted or slot.effect == "clock_drift" for slot in simulator.parameters])
    free[HEADING] = bool(DIRECTED & set(known))
    fit = fit_model(simulator, held_out, begun.values[None, :START], begun.values[START:], free, [0])
    clock = {"clock_drift": simulator.effects(fit.values)["clock_drift"]}
    there, steady = replace(setting, log=held_out, believed={**setting.believed, **lost.others}), Steady(clock, fit)
    own = _walk(there, steady)
    if own is None or not _believed(there, steady, own):
        return held_out
    return _counted(there, own).walk.retimed(held_out)
