"""What acts all the time shows before an event does: lasting effects that make the beginning of a log one motion.

Over the whole log the event is louder, and no lasting effect comes near what is left. On the beginning alone the score test
ranks them, and the few that promise most are fitted there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.changepoints.changepoint import (
    CHANGEPOINT_ITERATIONS,
    CONSISTENT_CHI2,
    FIRST_PREFIX_S,
    ConsistentPrefix,
    is_single_trajectory,
    longest_consistent_prefix,
)
from gateway.twin.reconcile.data.observations import slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.search.score_test import compute_signatures

Values = Mapping[str, Mapping[str, Value]]
MIN_EXTENSION_S = 10.0
"""By which a beginning must go on for longer with an effect than without."""
MAX_PREFIX_CANDIDATES = 6
"""Effects that are fitted to the beginning."""
MIN_SHARE_OF_BEST = 0.4
"""Share of what the best effect promises there; one with less does not make the beginning one motion."""


def effects_extending_consistent_prefix(
    setting: FitContext, base: Values, names: Sequence[str]
) -> list[ConsistentPrefix]:
    """Beginnings with each of the effects beside the base that carries the motion on further than the base does, best first.

    None where the base is one motion until something happens that no lasting effect explains.
    """
    log = setting.log
    alone = longest_consistent_prefix(setting, base)
    first_s = FIRST_PREFIX_S if alone is None else float(log.time_s[alone.end_sample]) + MIN_EXTENSION_S
    last = int(np.searchsorted(log.time_s, first_s))
    found = []
    for values in _rank_by_score_test(replace(setting, log=slice_samples(log, 0, last)), base, names):
        begun = longest_consistent_prefix(setting, values)
        if begun is not None and begun.end_sample >= last:
            found.append(begun)
    furthest = max((begun.end_sample for begun in found), default=0)
    return sorted(found, key=lambda begun: begun.chi2(log, furthest))


def _rank_by_score_test(setting: FitContext, base: Values, names: Sequence[str]) -> list[Values]:
    """By the score test; those that a fit shows to make one motion of the beginning, where the base makes none."""
    fit = setting.fit(base, iterations=CHANGEPOINT_ITERATIONS)
    if fit.chi2 < CONSISTENT_CHI2 * setting.log.n_values:
        return []
    scored = compute_signatures(setting, fit, base, names)
    drops = {name: scored.predicted_chi2_drop(name) for name in scored.of}
    ranked = sorted(drops, key=lambda name: -drops[name])[:MAX_PREFIX_CANDIDATES]
    tried: list[Values] = [
        {**base, name: EFFECTS[name].default_guess}
        for name in ranked
        if drops[name] > MIN_SHARE_OF_BEST * drops[ranked[0]]
    ]
    return [values for values in tried if is_single_trajectory(setting, values) is not None]
