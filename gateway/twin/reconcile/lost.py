"""Were samples lost without a trace? Only a random walk of time tells that from a clock that runs slow."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.observations import Observations
from gateway.twin.reconcile.search import Attempt, Search
from gateway.twin.reconcile.spectrum import machine_line
from gateway.twin.reconcile.wandering import EVERY, Walk, counted, find_walk, slow

Array = NDArray[np.float64]
LEAST_FRACTION = 0.002
CLOSED = 0.8
"""Share of what a steady clock leaves below the machines' frequencies that the walk must take away."""
WANDERS = 0.15
"""Cost of the walk for each knot: about a half for lost samples, a few hundredths for a clock that is only slow."""


def lost_samples(search: Search, best: Attempt) -> Walk | None:
    """The walk where the log, fitted with a clock that runs slow, shows one; None where nothing is left or nothing wanders."""
    log, always = search.setting.log, frozenset(search.always)
    slow_clock = search.attempts.get(always | {"clock_drift"})
    if slow_clock is None or not search.open(best) or log.duration_s < 2:
        return None
    fraction = -float(np.asarray(slow_clock.values["clock_drift"]["relative"]))
    if fraction < LEAST_FRACTION:
        return None
    return _walk(search, log, slow_clock.fit.values[:5], fraction, log.residual_sigma(slow_clock.fit.force_g))


def _walk(search: Search, o: Observations, start: Array, fraction: float, residual: Array) -> Walk | None:
    simulator = search.setting.simulator(())
    values = np.concatenate([start, simulator.values([], search.setting.believed)[5:]])
    walk = find_walk(simulator, values, o, fraction)
    dt = float(np.median(np.diff(o.time_s)))
    after = o.residual_sigma(simulator.predict(walk.values, walk.true_s, o.temperature_c))
    left, was = ((slow(each, dt) ** 2).sum() for each in (after, residual))
    noise = (slow(np.random.default_rng(0).normal(size=residual.shape), dt) ** 2).sum()
    wanders = walk.prior / (len(o.time_s) / EVERY) > WANDERS
    if not wanders or left - noise > (1 - CLOSED) * (was - noise) or walk.fraction < LEAST_FRACTION:
        return None
    if (
        machine_line(walk.true_s, o.force_g - simulator.predict(walk.values, walk.true_s, o.temperature_c), o.noise_g)
        is None
    ):
        return walk
    return counted(simulator, walk, o)


def retimed_held_out(search: Search, held_out: Observations, walk: Walk) -> Observations:
    """The held-out recording at its own true times, for judging what else is missing; as stamped where none are found."""
    setting = replace(search.setting, log=held_out)
    fit = setting.fit({"clock_drift": {"relative": -walk.fraction}})
    fraction = -float(np.asarray(setting.simulator(("clock_drift",)).effects(fit.values)["clock_drift"]["relative"]))
    own = _walk(search, held_out, fit.values[:5], max(fraction, LEAST_FRACTION), held_out.residual_sigma(fit.force_g))
    return held_out if own is None else own.retimed(held_out)
