"""What else acts where time wanders: a score test that leaves the walk free, so that neither hides the other.

Rao 1948, as in `score.py`; the walk is put in by its own spread, and so is its mean drift.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.decision.ambiguity_groups import LIKE_ANOTHER_ROPE
from gateway.twin.reconcile.fit.fit_context import Setting
from gateway.twin.reconcile.fit.multiple_shooting import TIMES
from gateway.twin.reconcile.residual.noise_inflation import colour
from gateway.twin.reconcile.search.candidate_fits import LEAST_EFFECT, LEAST_STATISTIC, Values
from gateway.twin.reconcile.search.score_test import NEUTRAL_CUTOFF_HZ, possible
from gateway.twin.reconcile.timing.time_warp_smoother import FreeTime, free_time, knots_of
from gateway.twin.reconcile.timing.timing_jitter import MOTION, answers, as_read, slow, spread_of
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
HELD = frozenset({"quantization", "clipping", "vibration"})
"""Seen in the readings, and not where a swing lives."""
RIVALS, NEAR = 3, 0.7
"""Effects of which a linear look cannot tell which it is: so many at most, with this share of what the best takes off."""


def companions(setting: Setting, others: Values, start: Array, true_s: Array, fraction: float) -> list[str]:
    """The lasting effect that takes most off, beside the others at these times, and its rivals; none where none is worth a name.

    `start` is the motion's under the others.
    """
    o, own = setting.log, setting.simulator(tuple(others))
    tried = [name for name in possible(setting) if name not in {*others, *setting.believed, *LIKE_ANOTHER_ROPE}]
    simulator = setting.simulator((*others, *tried))
    resting: Values = {"lowpass_lag": {"cutoff_hz": NEUTRAL_CUTOFF_HZ}} if "lowpass_lag" in tried else {}
    at = simulator.values(start, {**setting.believed, **others, **resting})
    _, by_time, by_values = answers(simulator, at, o, true_s)
    by_values = np.concatenate([by_values, (by_time * true_s[:, None])[:, :, None]], axis=2)
    values = own.values(start, {**setting.believed, **others})
    left_g = as_read(own, values, own.predict(values, true_s, o.temperature_c))
    knots, dt = knots_of(len(o.time_s)), float(np.median(np.diff(o.time_s)))
    residual = slow(o.residual_sigma(left_g), dt)
    equations = free_time(residual, by_time, by_values, np.zeros(knots.count), knots, spread_of(fraction, dt))
    fixed = [*MOTION, *free_places(simulator, others), by_values.shape[2] - 1]
    places = {name: free_places(simulator, {name: {}}) for name in tried}
    drops = {name: _drop(equations, simulator, fixed, places[name]) for name in tried}
    ranked = sorted(drops, key=lambda name: -drops[name])
    best = ranked[0]
    step, _ = equations.solved(chosen := [*fixed, *places[best]])
    walked = by_time * knots.at_samples(equations.walk(chosen, step))[:, None]
    unit = colour(o.time_s, residual - walked - by_values[:, :, chosen] @ step)
    if drops[best] < max(LEAST_STATISTIC + len(places[best]) * math.log(o.count), LEAST_EFFECT * o.count / unit) * unit:
        return []
    return [name for name in ranked[:RIVALS] if drops[name] > NEAR * drops[best]]


def free_places(simulator: Simulator, others: Mapping[str, object]) -> list[int]:
    """Where the parameters of these stand among the simulator's values, but for those that a step of time does not change."""
    return [
        i
        for i, slot in enumerate(simulator.parameters)
        if slot.effect in others and slot.effect not in HELD and slot.parameter not in TIMES
    ]


def _drop(equations: FreeTime, simulator: Simulator, fixed: list[int], places: list[int]) -> float:
    """By how much chi-square falls beside what is fitted anyway; signs of one-sided parameters are kept."""
    step, drop = equations.solved([*fixed, *places])
    slot = simulator.parameters[places[0]]
    one_sided = len(places) == 1 and slot.lower == 0
    if one_sided and step[-1] < 0:
        return 0.0
    return drop - equations.solved(fixed)[1]
