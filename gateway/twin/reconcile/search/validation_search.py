"""Effects that the log hides and the held-out recording shows: on the log the initial motion makes up for them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.fit.validation import ValidationFit, block_bootstrap_gain
from gateway.twin.reconcile.residual.residual_tests import has_excess
from gateway.twin.reconcile.search.candidates import MIN_VARIANCE_SHARE, CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import REFINE_ITERATIONS, SearchContext
from gateway.twin.reconcile.search.score_test import compute_signatures, scorable_effects
from gateway.twin.reconcile.search.validation_cache import Validator

Array = NDArray[np.float64]
MAX_CANDIDATES = 3
"""Effects that a score test on the selection part ranks highest, and that are fitted to the log."""


def extend_by_validation(
    table: CandidateTable,
    context: SearchContext,
    best: CandidateFit,
    validator: Validator,
    random: np.random.Generator,
) -> tuple[CandidateTable, CandidateFit]:
    """Add one more persistent effect if the best set explains the log alone, and only with that effect the selection part."""
    setting, selection = context.setting, validator.selection
    if best.has_unexplained_residual or setting.large_amplitude:
        return table, best
    before = validator.evaluate(best)
    if not has_excess(selection, before.fit):
        return table, best
    there = replace(setting, log=selection, model_effects=validator.model_effects)
    scored = compute_signatures(there, before.fit, best.values, scorable_effects(there))
    found, closest = best, before
    for name in sorted(scored.of, key=lambda each: -scored.predicted_chi2_drop(each))[:MAX_CANDIDATES]:
        values = {**best.values, name: EFFECTS[name].default_guess}
        table = context.fit(table, values, iterations=REFINE_ITERATIONS)
        candidate = table.get(values)
        if candidate is None or candidate.has_unexplained_residual:
            continue
        after = validator.evaluate(candidate)
        if after.fit.chi2 < closest.fit.chi2:
            found, closest = candidate, after
    is_closed = not has_excess(selection, closest.fit) and improves(before, closest, validator, random)
    return table, found if is_closed else best


def improves(before: ValidationFit, after: ValidationFit, validator: Validator, random: np.random.Generator) -> bool:
    """Whether less remains on the selection part, by more than chance and enough to matter."""
    selection = validator.selection
    time_s: Array = np.arange(int(selection.used.sum())) * np.float64(np.median(np.diff(selection.time_s)))
    low, _ = block_bootstrap_gain(
        selection.residual_sigma(before.fit.force_g)[selection.used],
        selection.residual_sigma(after.fit.force_g)[selection.used],
        time_s,
        random,
    )
    return low > 0 and before.reduced_chi2 - after.reduced_chi2 > MIN_VARIANCE_SHARE
