"""What the log hides and the held-out recording shows: on the log the initial motion and another effect make up for it."""

from dataclasses import replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.verdict import is_needed
from gateway.twin.reconcile.fit.validation import ValidationFit, evaluate_on_validation
from gateway.twin.reconcile.residual.residual_tests import has_excess
from gateway.twin.reconcile.search.candidate_fits import CandidateFit, Values
from gateway.twin.reconcile.search.event_search import POLISH_ROUNDS
from gateway.twin.reconcile.search.score_test import compute_signatures, scorable_effects
from gateway.twin.reconcile.search.search import Search

CANDIDATES = 3
"""Effects that a linear look at the held-out recording promises most of."""


def extend_by_validation_residual(
    search: Search, best: CandidateFit, held_out: Observations, rng: np.random.Generator
) -> CandidateFit:
    """The best set, and one more lasting effect if it explains the log alone and only with that one the held-out recording, too.

    Each candidate is fitted to the log like any other set; the held-out recording says which are worth a fit, and whether
    one closes what was left there.
    """
    setting = search.setting
    if best.has_unexplained_residual or setting.large_amplitude:
        return best
    before = _judged(search, best.values, held_out)
    if not has_excess(held_out, before.fit):
        return best
    there = replace(setting, log=held_out)
    scored = compute_signatures(there, before.fit, best.values, scorable_effects(there))
    found, least = best, before
    for name in sorted(scored.of, key=lambda each: -scored.predicted_chi2_drop(each))[:CANDIDATES]:
        attempt = search.fit_candidate({**best.values, name: EFFECTS[name].default_guess}, rounds=POLISH_ROUNDS)
        if attempt is None or attempt.has_unexplained_residual:
            continue
        after = _judged(search, attempt.values, held_out)
        if after.fit.chi2 < least.fit.chi2:
            found, least = attempt, after
    closed = not has_excess(held_out, least.fit) and is_needed(before, least, held_out, rng)
    return found if closed else best


def _judged(search: Search, values: Values, held_out: Observations) -> ValidationFit:
    return evaluate_on_validation(search.setting.rig, {**search.setting.model_effects, **values}, held_out)
