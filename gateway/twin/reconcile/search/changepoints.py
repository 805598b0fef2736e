"""When something happened: a scan over windows, and the longest beginning and end of a recording that are one motion each.

A transient effect leaves the load in another free trajectory. With the sensitivities to the initial state this is linear, and
cumulative sums give the fit before and after every window at once (generalised likelihood ratio, Basseville and Nikiforov 1993).
The longest consistent prefix and suffix linearise nothing, so that a changepoint is found even where the swing after it has
nothing in common with the swing before.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.model import EffectValues, shift_start
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.multiple_shooting import SCREENING_ITERATIONS, Fit, solve_damped
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

Array = NDArray[np.float64]
TIME_RESOLUTION_S = 0.5
"""Resolution of changepoints: grid of a scan, length of a tested block, margin around an event that is left out."""
LONGEST_EVENT_S = 25.0
"""Longest event; the best windows of no length, and up to a quarter, a half and all of this, are found."""
MARGIN_S = 4.0
"""Shortest trajectory before the first and after the last window, most of a period."""
INSIDE_COST = 3.05
"""Chi-square of a sample inside a window: that of its three values, and a little, so that of equal windows the shortest wins."""
RIDGE = 1e-9
"""Added to the scaled diagonal, for trajectories too short to determine the whole initial state."""
FIRST_PREFIX_S = 20.0
"""First part of the recording, which is assumed to contain no event."""
MIN_BLOCK_SAMPLES = 20
"""Fewest samples of a block that is tested; at low rates a block is longer than `TIME_RESOLUTION_S`."""
INCONSISTENT_MEAN_SQUARE = 1.8
"""Mean square, in sigma, above which a block is inconsistent: noise of 75 values exceeds it once in 38 000 blocks."""
FAR_INCONSISTENT_MEAN_SQUARE = 5.0
"""The same for one block alone; otherwise two in a row are needed. A winch shakes the rope when it starts, then hardly."""
CONSISTENT_CHI2 = 1.15
"""Reduced chi-square below which a segment is one trajectory: 6 standard deviations of it for the 3600 values of a minute."""
MIN_GROWTH = 1.05
"""Factor on a prefix's length by which it must grow for the search of its end to continue."""
MAX_SEARCH_STEPS = 8
"""Fits in which the end of a prefix or the start of a suffix is searched; halving finds it to 0.4 % of the recording."""
MIN_SUFFIX_S = 15.0
"""Shortest end of the recording that determines a trajectory."""


def scan_for_changepoints(
    time_s: Array, residual: Array, jacobian: Array, used: NDArray[np.bool_]
) -> tuple[EventWindow, ...]:
    """Return the best window of no length and up to some shares of `LONGEST_EVENT_S`; none in a recording that is all margin.

    The residual (n, 3) is in sigma, and so is the jacobian (n, 3, k) by the values that may differ before and after.
    """
    edges_s = np.arange(MARGIN_S, time_s[-1] - MARGIN_S, TIME_RESOLUTION_S)
    if not len(edges_s):
        return ()
    edges = np.searchsorted(time_s, edges_s)
    sums = _CumulativeSums.of(residual, jacobian, used)
    before = np.array([sums.chi2(0, edge) for edge in edges])
    after = np.array([sums.chi2(edge, len(time_s)) for edge in edges])
    inside = INSIDE_COST * (sums.count[edges][None, :] - sums.count[edges][:, None])
    remaining_chi2 = before[:, None] + after[None, :] + inside
    length_s = edges_s[None, :] - edges_s[:, None]
    windows = []
    for share in (0, 1 / 4, 1 / 2, 1):
        allowed = np.where((length_s >= 0) & (length_s <= share * LONGEST_EVENT_S), remaining_chi2, np.inf)
        i, j = np.unravel_index(np.argmin(allowed), allowed.shape)
        windows.append(EventWindow(float(edges_s[i]), float(edges_s[j]), float(allowed[i, j])))
    return tuple(windows)


def exclude_unmodelled_profiles(log: Observations, effects: EffectValues) -> Observations:
    """Return the log without the samples during events whose exact course no model knows.

    A winch starts and stops, and a struck object yields, in its own way. An event that lasts longer is not excluded.
    """
    outside = np.ones(len(log.time_s), dtype=np.bool_)
    for name, values in effects.items():
        interval_s = None if EFFECTS[name].profile_modelled else EFFECTS[name].interval_s(values)
        if interval_s is not None and interval_s[1] - interval_s[0] <= LONGEST_EVENT_S:
            start_s, end_s = interval_s
            outside &= (log.time_s < start_s - TIME_RESOLUTION_S) | (log.time_s > end_s + TIME_RESOLUTION_S)
    return replace(log, used=log.used & outside)


@dataclass(frozen=True, slots=True)
class _CumulativeSums:
    """Normal equations summed up to each sample."""

    count: Array
    square: Array
    gradient: Array
    normal: Array

    @staticmethod
    def of(residual: Array, jacobian: Array, used: NDArray[np.bool_]) -> "_CumulativeSums":
        def cumulative(values: Array) -> Array:
            return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])

        return _CumulativeSums(
            cumulative(used.astype(float)),
            cumulative((residual**2).sum(axis=1)),
            cumulative(np.einsum("nij,ni->nj", jacobian, residual)),
            cumulative(np.einsum("nij,nik->njk", jacobian, jacobian)),
        )

    def chi2(self, first: int, last: int) -> float:
        """Return chi-square of the samples from `first` to before `last` after a fit of their own."""
        normal, gradient = self.normal[last] - self.normal[first], self.gradient[last] - self.gradient[first]
        drop = solve_damped(normal, gradient, RIDGE) @ gradient
        return float(self.square[last] - self.square[first] - drop)


@dataclass(frozen=True, slots=True)
class ConsistentPrefix:
    """A beginning of a log that is one trajectory."""

    values: EffectValues
    """The effects as fitted to the prefix."""
    fit: Fit
    """The fit to the prefix, its simulation extrapolated over the log."""
    end_sample: int
    """First sample that is inconsistent with the fit."""

    def chi2(self, log: Observations, last: int) -> float:
        """Return chi-square of the samples before `last`."""
        return slice_samples(log, 0, last).chi2(self.fit.force_g[:last])


def longest_consistent_prefix(context: FitContext, values: EffectValues) -> ConsistentPrefix | None:
    """Return the longest prefix that is one trajectory with these effects, which are fitted to it.

    None where the first 20 s are inconsistent, or where the whole log is one trajectory. A prefix that ends after an event can
    still be consistent, because 20 s determine a small effect badly; its end is then searched by bisection.
    """
    log = context.log
    last, limit = int(np.searchsorted(log.time_s, FIRST_PREFIX_S)), len(log.time_s)
    longest, prefix = 0, None
    for _ in range(MAX_SEARCH_STEPS):
        fit = _extrapolate(context, values, last)
        if fit is None and prefix is None:
            return None
        if fit is None:
            limit, last = last, (longest + last) // 2
            continue
        end_sample = min(_first_inconsistent_sample(log, fit.force_g), limit)
        if end_sample == len(log.time_s):
            return None
        fitted = context.simulator(tuple(values)).effects(fit.values)
        longest, prefix = last, ConsistentPrefix({name: fitted[name] for name in values}, fit, end_sample)
        if end_sample <= last * MIN_GROWTH:
            break
        last = end_sample - int(np.searchsorted(log.time_s, TIME_RESOLUTION_S))
    return prefix


def fit_single_trajectory(context: FitContext, values: EffectValues) -> Fit | None:
    """Return a fit of these effects to the log; None where the log is not one trajectory, or none that can be simulated."""
    bound = CONSISTENT_CHI2 * context.log.n_values
    try:
        fit = context.fit(values, iterations=SCREENING_ITERATIONS, give_up_above=bound)
    except INTEGRATION_FAILURES:
        return None
    return fit if fit.chi2 < bound else None


def _extrapolate(context: FitContext, values: EffectValues, last: int) -> Fit | None:
    """Return a fit to the samples before `last`, with its simulation over the whole log."""
    log = context.log
    fit = fit_single_trajectory(replace(context, log=slice_samples(log, 0, last)), values)
    if fit is None:
        return None
    try:
        force_g = context.simulator(tuple(values)).predict(fit.values, log.time_s, log.temperature_c)
    except INTEGRATION_FAILURES:
        return None
    return replace(fit, force_g=force_g)


def _first_inconsistent_sample(log: Observations, force_g: Array) -> int:
    """Return the first sample of the first inconsistent blocks; the length of the log where there are none."""
    length = max(MIN_BLOCK_SAMPLES, int(np.searchsorted(log.time_s, TIME_RESOLUTION_S)))
    square = (log.residual_sigma(force_g) ** 2).mean(axis=1)
    count = len(square) // length
    mean_square = square[: count * length].reshape(count, length).mean(axis=1)
    exceeds = mean_square > INCONSISTENT_MEAN_SQUARE
    far = mean_square[:-1] > FAR_INCONSISTENT_MEAN_SQUARE
    inconsistent = np.flatnonzero((exceeds[:-1] & exceeds[1:]) | far)
    return int(inconsistent[0]) * length if len(inconsistent) else len(log.time_s)


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
        model_effects = shift_start(self.context.model_effects, start_s)
        sliced = replace(self.context, model_effects=model_effects, log=log)
        fit = fit_single_trajectory(sliced, shift_start(self.values, start_s))
        if fit is None:
            return False
        fitted = sliced.simulator(tuple(self.values)).effects(fit.values)
        self.values = shift_start({name: fitted[name] for name in self.values}, -start_s)
        self.chi2 = fit.chi2
        return True
