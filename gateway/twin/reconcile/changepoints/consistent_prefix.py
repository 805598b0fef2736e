"""The consistent prefix: the longest beginning of a recording that is one trajectory of a model.

Nothing is linearised, so a changepoint is found even where the swing after it has nothing in common with the swing before.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.model import EffectValues
from gateway.twin.reconcile.changepoints.changepoint_scan import TIME_RESOLUTION_S
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.levenberg_marquardt import SCREENING_ITERATIONS
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

Array = NDArray[np.float64]
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
