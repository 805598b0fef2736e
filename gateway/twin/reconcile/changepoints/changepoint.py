"""When an event began and ended: how far a motion from the beginning goes on, and from where one to the end holds.

Nothing is linearised, so it tells even where the swing after the event has nothing in common with the swing before.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.sensor import Vibration
from gateway.twin.reconcile.changepoints.changepoint_scan import COST_INSIDE
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
FIRST_PREFIX_S = 20.0
"""What is taken for free of events to begin with."""
SHORTEST_SUFFIX_S = 15.0
"""Of an end that tells a motion."""
BLOCK_S, MIN_BLOCK_SAMPLES = 0.5, 20
"""Length of a block, and least number of samples in it."""
INCONSISTENT_MEAN_SQUARE = 1.8
"""Mean square of a block from which it has parted; noise of 75 numbers gets there once in 30 000 blocks."""
FAR_INCONSISTENT_MEAN_SQUARE = 5.0
"""The same of a block by itself: a winch that starts is loud at once, and quiet again while it runs."""
CONSISTENT_CHI2 = 1.15
"""Reduced chi-square of a piece that is one motion."""
MAX_EXTENSIONS = 6
MIN_GROWTH = 1.05
"""Where a beginning goes on for less than this times its own length, it parts."""
MAX_BISECTIONS = 8
CHANGEPOINT_ITERATIONS = 6


@dataclass(frozen=True, slots=True)
class ConsistentPrefix:
    """Of a log, until something happens."""

    values: Values
    """The effects as fitted there."""
    fit: Fit
    """Carried on over the log."""
    end_sample: int
    """The sample where the log parts from it."""

    def chi2(self, log: Observations, last: int) -> float:
        """Of samples before this one."""
        return float((slice_samples(log, 0, last).residual_sigma(self.fit.force_g[:last]) ** 2).sum())


def locate_changepoint(setting: FitContext, values: Values, *, length: bool) -> EventWindow | None:
    """The stretch outside of which the log is a motion of the model with these effects before, and another after.

    The effects' parameters are fitted again on the beginning; with `length` the rope may be another after. None where the
    beginning is no motion of this model, where nothing parts, or where no end is one.
    """
    if any(EFFECTS[name].transient for name in values):
        return None
    begun = longest_consistent_prefix(setting, values)
    return None if begun is None else locate_next_changepoint(setting, begun, length=length)


def locate_next_changepoint(setting: FitContext, begun: ConsistentPrefix, *, length: bool) -> EventWindow | None:
    """The same where the beginning is known already."""
    log = setting.log
    extra: Values = {
        name: {} for name in EFFECTS.choose(length_like=True) if length and name not in setting.model_effects
    }
    ending = _fit_suffix(setting, begun.values, extra, begun.end_sample)
    if ending is None:
        return None
    first, after = ending
    left = begun.chi2(log, begun.end_sample) + after + COST_INSIDE * (first - begun.end_sample)
    return EventWindow(float(log.time_s[begun.end_sample]), float(log.time_s[first]), left)


def longest_consistent_prefix(setting: FitContext, values: Values) -> ConsistentPrefix | None:
    """The longest beginning that is one motion with these effects; None where the first 20 s are none, or all of the log is one.

    What 20 s say of a small effect may carry the motion past an event without showing it: then the end is sought by halving.
    """
    log = setting.log
    last, beyond = int(np.searchsorted(log.time_s, FIRST_PREFIX_S)), len(log.time_s)
    good, found = 0, None
    for _ in range(MAX_EXTENSIONS):
        carried = _extrapolate(setting, values, last)
        if carried is None:
            if found is None:
                return None
            beyond, last = last, (good + last) // 2
            continue
        reached = min(_first_inconsistent_block(log, carried.force_g), beyond)
        if reached == len(log.time_s):
            return None
        fitted = setting.simulator(tuple(values)).effects(carried.values)
        good, found = last, ConsistentPrefix({name: fitted[name] for name in values}, carried, reached)
        if reached <= last * MIN_GROWTH:
            break
        last = reached - int(np.searchsorted(log.time_s, BLOCK_S))
    return found


def is_single_trajectory(setting: FitContext, values: Values) -> Fit | None:
    """A fit of these effects to the log; None where the log is not one motion with them, or none that can be followed."""
    bound = CONSISTENT_CHI2 * setting.log.n_values
    try:
        fit = setting.fit(values, iterations=CHANGEPOINT_ITERATIONS, give_up_above=bound)
    except INTEGRATION_FAILURES:
        return None
    return fit if fit.chi2 < bound else None


def _extrapolate(setting: FitContext, values: Values, last: int) -> Fit | None:
    """The samples before this one as one motion, carried on over the log."""
    log = setting.log
    fit = is_single_trajectory(replace(setting, log=slice_samples(log, 0, last)), values)
    if fit is None:
        return None
    try:
        force_g = setting.simulator(tuple(values)).predict(fit.values, log.time_s, log.temperature_c)
    except INTEGRATION_FAILURES:
        return None
    return replace(fit, force_g=force_g)


def _first_inconsistent_block(log: Observations, force_g: Array) -> int:
    """First sample of the first two blocks that have parted, or of one that has by far; the log's length where none has."""
    length = max(MIN_BLOCK_SAMPLES, int(np.searchsorted(log.time_s, BLOCK_S)))
    square = (log.residual_sigma(force_g) ** 2).mean(axis=1)
    count = len(square) // length
    blocks = square[: count * length].reshape(count, length).mean(axis=1)
    loud = blocks > INCONSISTENT_MEAN_SQUARE
    parted = np.flatnonzero((loud[:-1] & loud[1:]) | (blocks[:-1] > FAR_INCONSISTENT_MEAN_SQUARE))
    return int(parted[0]) * length if len(parted) else len(log.time_s)


def _shift_phase(values: Values, then_s: float) -> Values:
    """With a machine's phase as it is then."""
    if Vibration.name not in values:
        return values
    line = values[Vibration.name]
    turned = float(np.asarray(line["phase_rad"])) + 2 * np.pi * float(np.asarray(line["frequency_hz"])) * then_s
    return {**values, Vibration.name: {**line, "phase_rad": (turned + np.pi) % (2 * np.pi) - np.pi}}


def _fit_suffix(setting: FitContext, known: Values, extra: Values, from_sample: int) -> tuple[int, float] | None:
    """The first sample from which the log is one motion, and its chi-square; found by halving.

    With the effects as the beginning has them; where that holds nowhere, they are fitted again: a wind's direction turns
    with the housing, and a beginning does not tell every value well.
    """
    log = setting.log
    low, high = from_sample, int(np.searchsorted(log.time_s, log.time_s[-1] - SHORTEST_SUFFIX_S))
    if high <= low:
        return None
    # Fitted again, what is like another rope would make up for a rope that became another.
    again = {
        name: each for name, each in known.items() if not (EFFECTS[name].scales_period or EFFECTS[name].length_like)
    }
    for free in ({}, again) if again else ({},):
        held = {**setting.model_effects, **{name: each for name, each in known.items() if name not in free}}
        after = _SuffixFit(replace(setting, model_effects=held), {**extra, **free})
        if after.extend_to(high):
            break
    else:
        return None
    for _ in range(MAX_BISECTIONS):
        middle = (low + high) // 2
        low, high = (low, middle) if after.extend_to(middle) else (middle, high)
    return high, after.chi2


@dataclass(slots=True)
class _SuffixFit:
    """The longest end so far that is one motion: what was fitted to it starts the next fit."""

    setting: FitContext
    values: Values
    chi2: float = np.inf

    def extend_to(self, first: int) -> bool:
        """From this sample on the log is one motion; kept, if so."""
        log = slice_samples(self.setting.log, first, len(self.setting.log.time_s))
        then_s = float(self.setting.log.time_s[first])
        known = replace(self.setting, model_effects=_shift_phase(self.setting.model_effects, then_s), log=log)
        fit = is_single_trajectory(known, _shift_phase(self.values, then_s))
        if fit is None:
            return False
        found = known.simulator(tuple(self.values)).effects(fit.values)
        self.values = _shift_phase({name: found[name] for name in self.values}, -then_s)
        self.chi2 = fit.chi2
        return True
