"""When an event began and ended: how far a motion from the beginning goes on, and from where one to the end holds.

Nothing is linearised, so it tells even where the swing after the event has nothing in common with the swing before.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Value
from gateway.twin.reconcile.events import INSIDE, Window
from gateway.twin.reconcile.observations import Observations, piece
from gateway.twin.reconcile.setting import Setting
from gateway.twin.reconcile.shooting import Fit

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
FIRST_S = 20.0
"""What is taken for free of events to begin with."""
SHORTEST_S = 15.0
"""Of an end that tells a motion."""
BLOCK_S, FEWEST = 0.5, 20
"""Length of a block, and least number of samples in it."""
PARTED = 1.8
"""Mean square of a block from which it has parted; noise of 75 numbers gets there once in 30 000 blocks."""
JOINED = 1.15
"""Reduced chi-square of a piece that is one motion."""
CHANGED = ("rope_length", "housing_position")
"""After hoisting both are others; after a change of the load the first."""
EXTENSIONS = 6
NEARLY = 1.05
"""Where a beginning goes on for less than this times its own length, it parts."""
HALVINGS = 6
ROUNDS = 6


def parting(setting: Setting, values: Values, *, length: bool) -> Window | None:
    """The stretch outside of which the log is a motion of the model with these effects before, and another after.

    The effects' parameters are fitted again on the beginning; with `length` the rope may be another after. None where the
    beginning is no motion of this model, where nothing parts, or where no end is one.
    """
    if any(EFFECTS[name].transient for name in values):
        return None
    found = _beginning(setting, values)
    if found is None:
        return None
    fit, last = found
    log = setting.log
    fitted = setting.simulator(tuple(values)).effects(fit.values)
    known = replace(setting, believed={**setting.believed, **{name: fitted[name] for name in values}})
    extra: Values = {name: {} for name in CHANGED if length and name not in known.believed}
    ending = _ending(known, extra, last)
    if ending is None:
        return None
    first, after = ending
    before = piece(log, 0, last).residual_sigma(fit.force_g[:last])
    left = float((before**2).sum()) + after + INSIDE * (first - last)
    return Window(float(log.time_s[last]), float(log.time_s[first]), left)


def _beginning(setting: Setting, values: Values) -> tuple[Fit, int] | None:
    """A fit of the longest beginning that is one motion, carried on over the log, and the sample where it parts."""
    log, simulator = setting.log, setting.simulator(tuple(values))
    last = int(np.searchsorted(log.time_s, FIRST_S))
    for left in reversed(range(EXTENSIONS)):
        part = piece(log, 0, last)
        fit = replace(setting, log=part).fit(values, rounds=ROUNDS)
        if fit.chi2 > JOINED * part.count:
            return None
        force_g = simulator.predict(fit.values, log.time_s, log.temperature_c)
        fit, reached = replace(fit, force_g=force_g), _parts_at(log, force_g)
        if reached is None:
            return None
        if reached <= last * NEARLY or not left:
            return fit, reached
        last = reached - int(np.searchsorted(log.time_s, BLOCK_S))
    return None


def _parts_at(log: Observations, force_g: Array) -> int | None:
    """First sample of the first two blocks that have parted; None where none has."""
    length = max(FEWEST, int(np.searchsorted(log.time_s, BLOCK_S)))
    square = (log.residual_sigma(force_g) ** 2).mean(axis=1)
    count = len(square) // length
    loud = square[: count * length].reshape(count, length).mean(axis=1) > PARTED
    both = np.flatnonzero(loud[:-1] & loud[1:])
    return int(both[0]) * length if len(both) else None


def _from_then(values: Values, then_s: float) -> Values:
    """With a machine's phase as it is then."""
    if "vibration" not in values:
        return values
    line = values["vibration"]
    turned = float(np.asarray(line["phase_rad"])) + 2 * np.pi * float(np.asarray(line["frequency_hz"])) * then_s
    return {**values, "vibration": {**line, "phase_rad": (turned + np.pi) % (2 * np.pi) - np.pi}}


def _ending(setting: Setting, extra: Values, from_sample: int) -> tuple[int, float] | None:
    """The first sample from which the log is one motion, and its chi-square; found by halving."""
    log = setting.log

    def chi2(first: int) -> float:
        believed = _from_then(setting.believed, float(log.time_s[first]))
        return (
            replace(setting, believed=believed, log=piece(log, first, len(log.time_s))).fit(extra, rounds=ROUNDS).chi2
        )

    def joined(first: int, value: float) -> bool:
        return value < JOINED * piece(log, first, len(log.time_s)).count

    low, high = from_sample, int(np.searchsorted(log.time_s, log.time_s[-1] - SHORTEST_S))
    if high <= low:
        return None
    best = chi2(high)
    if not joined(high, best):
        return None
    for _ in range(HALVINGS):
        middle = (low + high) // 2
        tried = chi2(middle)
        if joined(middle, tried):
            high, best = middle, tried
        else:
            low = middle
    return high, best
