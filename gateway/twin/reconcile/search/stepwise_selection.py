"""Steps from the best set of effects to a better one: forward step, swaps, backward elimination."""

import math

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.decision.evidence import VALIDATED_MARGIN
from gateway.twin.reconcile.search.budget import FitRequest
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import REFINE_ITERATIONS, SearchContext
from gateway.twin.reconcile.search.events import fit_events_in_windows, needs_more, refine
from gateway.twin.reconcile.search.persistent import (
    MAX_SCORED,
    baseline_of,
    fit_by_score,
    fit_guessed_effects,
    parents,
    requests_beside,
)

MAX_EFFECTS = 3
"""Effects of one answer: recordings of ordinary length do not separate more."""
MAX_SINGLE_REMAINDER = 0.8
"""Share of the gap that the best single effect may leave for a second one to be searched for."""
MAX_PAIR_REMAINDER = 0.1
"""Share of the gap that a pair may leave for a third effect to be searched for; beyond it a third one only imitates."""
MAX_THIRD_REMAINDER = 0.5
"""Share of the residual of a pair that a third effect may leave; one that leaves more only imitates what is missing."""

SETTLED_SHARE = 0.5
"""Share of the gap that is open without an effect from which it is necessary beyond doubt."""


def grow(table: CandidateTable, context: SearchContext, best: CandidateFit) -> tuple[CandidateTable, CandidateFit]:
    """Add effects to the best single one until the rest is noise or nothing significant helps, then eliminate backwards."""
    base = baseline_of(table, context)
    if best.reduced_chi2 - 1 > MAX_SINGLE_REMAINDER * (base.reduced_chi2 - 1):
        return _eliminate_and_record(table, context, best)
    while len(best.values) < len(base.values) + MAX_EFFECTS:
        if not needs_more(best, context) or context.budget.is_exhausted:
            break
        table, ahead = _forward_step(table, context, len(best.values))
        if ahead.names == best.names:
            best = ahead
            break
        is_third = len(best.values) > len(base.values) + 1
        if is_third and ahead.reduced_chi2 - 1 > MAX_THIRD_REMAINDER * (best.reduced_chi2 - 1):
            break
        if ahead.reduced_chi2 - 1 > MAX_PAIR_REMAINDER * (base.reduced_chi2 - 1):
            table, best = table.record_move(best, ahead), ahead
            break
        table, swapped = try_swaps(table, context, ahead)
        table, best = table.record_move(best, swapped), swapped
    return _eliminate_and_record(table, context, best)


def try_swaps(table: CandidateTable, context: SearchContext, best: CandidateFit) -> tuple[CandidateTable, CandidateFit]:
    """Replace each effect of a set by the best others, the rest kept; return the best set of all."""
    base = baseline_of(table, context)
    for name in sorted(best.names - base.names):
        if context.budget.is_exhausted:
            break
        rest = best.without(name)
        if table.get(rest) is None:
            table = context.fit(table, rest)
        without = table.get(rest)
        if without is None:
            continue
        scored = context.signatures(without)
        likely = sorted(scored.of, key=lambda n: -scored.predicted_chi2_drop(n))[:MAX_SCORED]
        table = context.fit_in_turn(table, requests_beside(table, context, without, sorted(likely)))
    table = table.start_round()
    table = _fit_rivals_with_swapped(table, context, best, table.best)
    found = table.best
    keeps = table.is_significant(best, found) or len(found.values) <= len(best.values)
    return table, found if keeps else best


def _fit_rivals_with_swapped(
    table: CandidateTable, context: SearchContext, before: CandidateFit, after: CandidateFit
) -> CandidateTable:
    """Fit the sets that were nearly as good as the one before a swap, with the effect that was swapped in.

    What was second beside one loss, such as a length, may be first beside another.
    """
    dropped, added = before.names - after.names, after.names - before.names
    if len(dropped) != 1 or len(added) != 1:
        return table
    (old,), (new,), limit = dropped, added, table.bic(before) + VALIDATED_MARGIN
    for rival in [fit for fit in table.ranked(len(before.values)) if table.bic(fit) < limit and dropped <= fit.names]:
        values = {**rival.without(old), new: after.values[new]}
        if table.get(values) is None and new not in rival.names and not context.budget.is_exhausted:
            table = context.fit(table, values, context.segment_starts(rival))
    return table


def eliminate(
    table: CandidateTable, context: SearchContext, best: CandidateFit, *, held_by_parts: bool = False
) -> tuple[CandidateTable, CandidateFit]:
    """Remove effects whose absence costs no significant chi-square, one at a time."""
    give_up_above = max(table.give_up_above, _settled_chi2(table, context, best))
    shorter = [
        FitRequest(
            best.without(name),
            iterations=REFINE_ITERATIONS,
            give_up_above=give_up_above,
            held_by_parts=held_by_parts,
        )
        for name in sorted(each for each in best.names if not EFFECTS[each].detected_in_samples)
    ]

    def sufficient(now: CandidateTable) -> CandidateFit | None:
        fits = (now.get(each.values) for each in shorter)
        return next((fit for fit in fits if fit is not None and not now.is_significant(fit, best)), None)

    table = context.fit_in_turn(table, shorter, lambda now, _: sufficient(now) is None)
    fewer = sufficient(table)
    return (table, best) if fewer is None else eliminate(table, context, fewer, held_by_parts=held_by_parts)


def _settled_chi2(table: CandidateTable, context: SearchContext, best: CandidateFit) -> float:
    """Return the chi-square from which on a set without one of the effects need not converge: that effect is necessary.

    Only the sets of a large swing take long to converge.
    """
    if not best.has_unexplained_residual:
        return 0.0
    if not context.setting.large_amplitude:
        return math.inf
    return best.fit.chi2 + SETTLED_SHARE * (baseline_of(table, context).fit.chi2 - best.fit.chi2)


def _forward_step(table: CandidateTable, context: SearchContext, size: int) -> tuple[CandidateTable, CandidateFit]:
    """Fit one more effect beside each of the best sets of a size; return the best set of all if it is significant."""
    before = table.best
    for parent in parents(table, context, size):
        if context.budget.is_exhausted:
            break
        table = fit_by_score(table, context, parent, at_most=MAX_SCORED).start_round()
        if not context.setting.large_amplitude:
            table = fit_guessed_effects(table, context, parent).start_round()
            if not (table.is_explained and table.best is not parent):
                table = fit_events_in_windows(table, context, parent)
    table = refine(table, context, size + 1).start_round()
    after = table.best
    return table, after if table.is_significant(before, after) else before


def _eliminate_and_record(
    table: CandidateTable, context: SearchContext, best: CandidateFit
) -> tuple[CandidateTable, CandidateFit]:
    table, remaining = eliminate(table.start_round(), context, best)
    return table.record_move(best, remaining), remaining
