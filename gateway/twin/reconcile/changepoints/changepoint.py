"""The changepoints of an event: the end of a consistent prefix, and the start of a consistent suffix."""

from dataclasses import dataclass, replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.sensor import Vibration
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.changepoints.changepoint_scan import INSIDE_COST
from gateway.twin.reconcile.changepoints.consistent_prefix import (
    MAX_SEARCH_STEPS,
    fit_single_trajectory,
    longest_consistent_prefix,
)
from gateway.twin.reconcile.data.observations import slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext

MIN_SUFFIX_S = 15.0
"""Shortest end of the recording that determines a trajectory."""


def locate_changepoint(context: FitContext, values: EffectValues, *, length: bool) -> EventWindow | None:
    """Return the window outside of which the log is one trajectory of the model with these effects before, and one after.

    The effects are fitted to the prefix; with `length` the rope may have another length after the event. None where the first
    20 s are inconsistent with the model, where all of the log is consistent, or where no suffix is.
    """
    if any(EFFECTS[name].transient for name in values):
        return None
    prefix = longest_consistent_prefix(context, values)
    if prefix is None:
        return None
    log = context.log
    length_effects: EffectValues = {
        name: {} for name in EFFECTS.choose(length_like=True) if length and name not in context.model_effects
    }
    suffix = _longest_consistent_suffix(context, prefix.values, length_effects, prefix.end_sample)
    if suffix is None:
        return None
    first, suffix_chi2 = suffix
    inside = INSIDE_COST * (first - prefix.end_sample)
    remaining_chi2 = prefix.chi2(log, prefix.end_sample) + suffix_chi2 + inside
    return EventWindow(float(log.time_s[prefix.end_sample]), float(log.time_s[first]), remaining_chi2)


def _longest_consistent_suffix(
    context: FitContext, prefix_values: EffectValues, further: EffectValues, from_sample: int
) -> tuple[int, float] | None:
    """Return the first sample of the longest suffix that is one trajectory, and its chi-square; by bisection.

    The effects keep their values from the prefix, and the `further` ones are fitted. Where no suffix is consistent with that,
    all are fitted: the direction of a wind turns with the housing, and a prefix determines some values badly.
    """
    log = context.log
    low, high = from_sample, int(np.searchsorted(log.time_s, log.time_s[-1] - MIN_SUFFIX_S))
    if high <= low:
        return None
    # An effect that resembles a wrong rope is never fitted again: it would hide that the rope changed.
    refittable = {
        name: each
        for name, each in prefix_values.items()
        if not (EFFECTS[name].scales_period or EFFECTS[name].length_like)
    }
    for refitted in ({}, refittable) if refittable else ({},):
        held = {name: each for name, each in prefix_values.items() if name not in refitted}
        suffix_context = replace(context, model_effects={**context.model_effects, **held})
        suffix = _SuffixFit(suffix_context, {**further, **refitted})
        if suffix.extend_to(high):
            break
    else:
        return None
    for _ in range(MAX_SEARCH_STEPS):
        middle = (low + high) // 2
        low, high = (low, middle) if suffix.extend_to(middle) else (middle, high)
    return high, suffix.chi2


@dataclass(slots=True)
class _SuffixFit:
    """The longest consistent suffix so far; its values are the initial guess of the next one."""

    context: FitContext
    values: EffectValues
    chi2: float = np.inf

    def extend_to(self, first: int) -> bool:
        """Fit the suffix from this sample on, and keep the fit if it is one trajectory."""
        log = slice_samples(self.context.log, first, len(self.context.log.time_s))
        start_s = float(self.context.log.time_s[first])
        model_effects = _shift_phase(self.context.model_effects, start_s)
        sliced = replace(self.context, model_effects=model_effects, log=log)
        fit = fit_single_trajectory(sliced, _shift_phase(self.values, start_s))
        if fit is None:
            return False
        fitted = sliced.simulator(tuple(self.values)).effects(fit.values)
        self.values = _shift_phase({name: fitted[name] for name in self.values}, -start_s)
        self.chi2 = fit.chi2
        return True


def _shift_phase(values: EffectValues, by_s: float) -> EffectValues:
    """Return the effects with a vibration's phase for a recording that starts later."""
    if Vibration.name not in values:
        return values
    vibration = values[Vibration.name]
    rate_1_s = 2 * np.pi * float(np.asarray(vibration["frequency_hz"]))
    phase_rad = float(np.asarray(vibration["phase_rad"])) + rate_1_s * by_s
    return {**values, Vibration.name: {**vibration, "phase_rad": (phase_rad + np.pi) % (2 * np.pi) - np.pi}}
