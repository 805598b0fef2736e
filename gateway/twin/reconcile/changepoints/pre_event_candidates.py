"""Persistent effects that extend the consistent prefix.

Over the whole log a transient effect dominates, and no persistent effect lowers the residual much. On the prefix alone the score
test ranks the persistent ones, and the most promising are fitted there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.changepoints.consistent_prefix import (
    CONSISTENT_CHI2,
    FIRST_PREFIX_S,
    ConsistentPrefix,
    fit_single_trajectory,
    longest_consistent_prefix,
)
from gateway.twin.reconcile.data.observations import slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.levenberg_marquardt import SCREENING_ITERATIONS
from gateway.twin.reconcile.search.score_test import compute_signatures
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

MIN_EXTENSION_S = 10.0
"""Length by which an effect must extend the prefix, more than a period."""
MAX_CANDIDATES = 6
"""Number of effects that are fitted to the prefix."""
MIN_SHARE_OF_BEST = 0.4
"""Least predicted decrease of chi-square, relative to the best effect's."""


def effects_extending_consistent_prefix(
    context: FitContext, base: EffectValues, names: Sequence[str]
) -> list[ConsistentPrefix]:
    """Return the consistent prefixes with one more of the effects `names` that are longer than that of the base, best first.

    The list is empty where the base is one trajectory until an event.
    """
    log = context.log
    base_prefix = longest_consistent_prefix(context, base)
    required_s = FIRST_PREFIX_S if base_prefix is None else float(log.time_s[base_prefix.end_sample]) + MIN_EXTENSION_S
    required = int(np.searchsorted(log.time_s, required_s))
    prefixes = []
    for values in _rank_by_score_test(replace(context, log=slice_samples(log, 0, required)), base, names):
        prefix = longest_consistent_prefix(context, values)
        if prefix is not None and prefix.end_sample >= required:
            prefixes.append(prefix)
    farthest = max((prefix.end_sample for prefix in prefixes), default=0)
    return sorted(prefixes, key=lambda prefix: prefix.chi2(log, farthest))


def _rank_by_score_test(context: FitContext, base: EffectValues, names: Sequence[str]) -> list[EffectValues]:
    """Return the sets of base and one effect with which the log is one trajectory; none where it is with the base alone."""
    try:
        fit = context.fit(base, iterations=SCREENING_ITERATIONS)
    except INTEGRATION_FAILURES:
        return []
    if fit.chi2 < CONSISTENT_CHI2 * context.log.n_values:
        return []
    signatures = compute_signatures(context, fit, base, names)
    drops = {name: signatures.predicted_chi2_drop(name) for name in signatures.of}
    ranked = sorted(drops, key=lambda name: -drops[name])[:MAX_CANDIDATES]
    candidates: list[EffectValues] = [
        {**base, name: EFFECTS[name].default_guess}
        for name in ranked
        if drops[name] > MIN_SHARE_OF_BEST * drops[ranked[0]]
    ]
    return [values for values in candidates if fit_single_trajectory(context, values) is not None]
