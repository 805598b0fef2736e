"""What the log hides and the held-out recording shows: on the log the initial motion and another effect make up for it."""

from dataclasses import replace

import numpy as np

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.verdict import helps
from gateway.twin.reconcile.fit.validation import Judged, judge
from gateway.twin.reconcile.residual.residual_tests import left_open
from gateway.twin.reconcile.search.candidate_fits import Attempt, Values
from gateway.twin.reconcile.search.event_search import POLISH_ROUNDS
from gateway.twin.reconcile.search.initial_guesses import first_values
from gateway.twin.reconcile.search.score_test import possible, signatures
from gateway.twin.reconcile.search.search import Search

CANDIDATES = 3
"""Effects that a linear look at the held-out recording promises most of."""


def beside(search: Search, best: Attempt, held_out: Observations, rng: np.random.Generator) -> Attempt:
    """The best set, and one more lasting effect if it explains the log alone and only with that one the held-out recording, too.

    Each candidate is fitted to the log like any other set; the held-out recording says which are worth a fit, and whether
    one closes what was left there.
    """
    setting = search.setting
    if best.open or setting.wide:
        return best
    before = _judged(search, best.values, held_out)
    if not left_open(held_out, before.fit):
        return best
    there = replace(setting, log=held_out)
    scored = signatures(there, before.fit, best.values, possible(there))
    found, least = best, before
    for name in sorted(scored.of, key=lambda each: -scored.drop(each))[:CANDIDATES]:
        attempt = search.try_values({**best.values, name: first_values(name)}, rounds=POLISH_ROUNDS)
        if attempt is None or attempt.open:
            continue
        after = _judged(search, attempt.values, held_out)
        if after.fit.chi2 < least.fit.chi2:
            found, least = attempt, after
    closed = not left_open(held_out, least.fit) and helps(before, least, held_out, rng)
    return found if closed else best


def _judged(search: Search, values: Values, held_out: Observations) -> Judged:
    return judge(search.setting.rig, {**search.setting.believed, **values}, held_out)
