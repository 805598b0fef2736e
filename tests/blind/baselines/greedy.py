"""Greedy forward selection: the effect that lowers BIC most is added, until none lowers it; nothing is ever dropped.

`python -m tests.blind.baselines.greedy reconcile LOG --rig RIG --held-out LOG2 --json FILE --prediction FILE`
"""

import sys

import numpy as np

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.simulator import Simulator
from tests.blind.baselines.files import Found, Measured, answer
from tests.blind.baselines.fitting import (
    Fit,
    base_fit,
    conclude,
    free_on_log,
    guesses,
    levenberg_marquardt,
    linear_gain,
    sensible,
)
from tests.blind.mechanics import Array

MOST_EFFECTS = 4
SHORT_LIST, ROUNDS = 3, 8
"""So many are refitted in each round, those that promise most by linearisation, in so many steps."""


def greedy(rig: TwinRig, log: Measured, held_out: Measured) -> Found:
    """Forward only."""
    base = fit = base_fit(rig, log)
    names: tuple[str, ...] = ()
    while len(names) < MOST_EFFECTS:
        added = _best_addition(rig, log, fit, names)
        if added is None or bic(added, log) >= bic(fit, log):
            break
        (new,) = set(added.simulator.effect_names) - set(names)
        names, fit = (*names, new), added
    return conclude(rig, log, held_out, base, fit, names)


def bic(fit: Fit, measured: Measured) -> float:
    """Of the stated noise."""
    return fit.cost + len(fit.values) * float(np.log(measured.n_values))


def _best_addition(rig: TwinRig, log: Measured, fit: Fit, names: tuple[str, ...]) -> Fit | None:
    residual_g = log.force_g - fit.simulator.predict(fit.values, log.time_s, log.temperature_c)
    promises = []
    for name in sensible(log):
        if name in names:
            continue
        simulator = Simulator(rig, [*names, name])
        for guess in guesses(name, log, residual_g):
            values = simulator.values(
                list(fit.values[: fit.simulator.n_initial_states]), {**fit.effects(), name: guess}
            )
            gain = linear_gain(
                simulator, log, _off_neutral(simulator, values, name, fit.effects()), free_on_log(simulator)
            )[0]
            promises.append((gain, name, values))
    promises.sort(key=lambda promise: -promise[0])
    best: dict[str, tuple[Array, float]] = {}
    for gain, name, values in promises:
        best.setdefault(name, (values, gain))
    fits = []
    for name, (values, _) in list(best.items())[:SHORT_LIST]:
        simulator = Simulator(rig, [*names, name])
        near = _off_neutral(simulator, values, name, fit.effects())
        fits.append(levenberg_marquardt(simulator, log, near, free_on_log(simulator), ROUNDS))
    return min(fits, key=lambda one: bic(one, log), default=None)


def _off_neutral(simulator: Simulator, values: Array, name: str, kept: EffectValues) -> Array:
    """A touch of the effect, so that its times and frequencies have derivatives."""
    moved = values.copy()
    for i, slot in enumerate(simulator.parameters):
        if slot.effect == name and values[i] == slot.neutral and name not in kept:
            moved[i] = np.clip(slot.neutral + 0.3 * slot.scale, slot.lower, slot.upper)
    return moved


if __name__ == "__main__":
    sys.exit(answer(greedy))
