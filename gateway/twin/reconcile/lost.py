"""Were samples lost without a trace? Only a random walk of time tells that from a clock that runs slow."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.attempts import Attempt, Values
from gateway.twin.reconcile.observations import Observations
from gateway.twin.reconcile.search import Search
from gateway.twin.reconcile.setting import Setting
from gateway.twin.reconcile.shooting import Fit
from gateway.twin.reconcile.spectrum import machine_line
from gateway.twin.reconcile.wandering import Walk, counted, find_walk, slow

Array = NDArray[np.float64]
LEAST_FRACTION = 0.002
CLOSED = 0.8
"""Share of what a steady clock leaves below the machines' frequencies that the walk must take away."""
WANDERS = (0.65, 1.6)
"""Cost of the walk for each of its steps that the readings tell: 1 for lost samples, by their own law; half of it and less for a
clock that is only slow, twice and more for a swing that itself changed."""


def lost_samples(search: Search, slow_clock: Attempt | None) -> Walk | None:
    """The walk where the log, fitted with a clock that runs slow, shows one; None where nothing is left or nothing wanders."""
    if slow_clock is None or "clock_drift" not in slow_clock.values or not search.best().open:
        return None
    fraction = -float(np.asarray(slow_clock.values["clock_drift"]["relative"]))
    if fraction < LEAST_FRACTION or {"double_pendulum", "rope_stretch"} & set(slow_clock.values):
        return None
    return _walk(search.setting, without_clock(slow_clock.values), slow_clock.fit, fraction)


def without_clock(values: Values) -> Values:
    """The other effects."""
    return {name: each for name, each in values.items() if name != "clock_drift"}


def _walk(setting: Setting, others: Values, slow_clock: Fit, fraction: float) -> Walk | None:
    o, simulator = setting.log, setting.simulator(tuple(others))
    values = simulator.values(list(slow_clock.values[:5]), {**setting.believed, **others})
    walk = find_walk(simulator, values, o, fraction)
    if walk is None:
        return None
    dt = float(np.median(np.diff(o.time_s)))
    after_g = simulator.predict(walk.values, walk.true_s, o.temperature_c)
    left, was = ((slow(o.residual_sigma(each), dt) ** 2).sum() for each in (after_g, slow_clock.force_g))
    noise = (slow(np.random.default_rng(0).normal(size=after_g.shape), dt) ** 2).sum()
    wanders = WANDERS[0] < walk.wander < WANDERS[1]
    if not wanders or left - noise > (1 - CLOSED) * (was - noise) or walk.fraction < LEAST_FRACTION:
        return None
    if machine_line(walk.true_s, o.force_g - after_g, o.noise_g) is None:
        return walk
    return counted(simulator, walk, o)


def retimed_held_out(setting: Setting, others: Values, held_out: Observations, walk: Walk) -> Observations:
    """The held-out recording at its own true times, for judging what else is missing; as stamped where none are found."""
    known = replace(setting, log=held_out, believed={**setting.believed, **others})
    fit = known.fit({"clock_drift": {"relative": -walk.fraction}})
    found = known.simulator(("clock_drift",)).effects(fit.values)
    fraction = max(-float(np.asarray(found["clock_drift"]["relative"])), LEAST_FRACTION)
    own = _walk(known, {}, fit, fraction)
    return held_out if own is None else own.retimed(held_out)
