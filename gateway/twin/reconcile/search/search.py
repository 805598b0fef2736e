"""The search: from the nominal model to the best set of effects, one table of candidate fits after the other.

It begins with what needs no search and with persistent effects. Where a clock error is suspected and samples turn out to be lost,
it begins again at true times. Then named steps fit single effects and pairs, and further effects are added to the best.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.crane_inputs import KnownModel
from gateway.twin.reconcile.data.observations import Recordings
from gateway.twin.reconcile.fit.multiple_shooting import REFINE_ITERATIONS
from gateway.twin.reconcile.sample_loss import find_sample_loss, retime_validation
from gateway.twin.reconcile.search.candidates import (
    LITTLE_OF_GAP,
    MAX_EFFECTS,
    MOST_OF_GAP,
    VALIDATED_MARGIN,
    CandidateFit,
    CandidateTable,
)
from gateway.twin.reconcile.search.context import Budget, FitRequest, SearchContext, make_context
from gateway.twin.reconcile.search.signatures import any_length_changes, coincident_effects
from gateway.twin.reconcile.search.steps import (
    MAX_SCORED,
    baseline_of,
    fit_baseline,
    fit_bodies,
    fit_by_score,
    fit_clock_hypotheses,
    fit_events_in_windows,
    fit_guessed_effects,
    fit_persistent_effects,
    fit_persistent_pairs,
    has_event,
    needs_more,
    parents,
    refine,
    requests_beside,
)
from gateway.twin.reconcile.search.validation import Validator

MAX_SINGLE_REMAINDER = 0.8
"""Share of the gap that the best single effect may leave for a second one to be searched for."""


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
        if is_third and ahead.reduced_chi2 - 1 > MOST_OF_GAP * (best.reduced_chi2 - 1):
            break
        if ahead.reduced_chi2 - 1 > LITTLE_OF_GAP * (base.reduced_chi2 - 1):
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


def eliminate(table: CandidateTable, context: SearchContext, best: CandidateFit) -> tuple[CandidateTable, CandidateFit]:
    """Remove effects whose absence costs no significant chi-square, one at a time."""
    give_up_above = max(table.give_up_above, _settled_chi2(table, context, best))
    shorter = [
        FitRequest(best.without(name), iterations=REFINE_ITERATIONS, give_up_above=give_up_above)
        for name in sorted(each for each in best.names if not EFFECTS[each].detected_in_samples)
    ]

    def sufficient(now: CandidateTable) -> CandidateFit | None:
        fits = (now.get(each.values) for each in shorter)
        return next((fit for fit in fits if fit is not None and not now.is_significant(fit, best)), None)

    table = context.fit_in_turn(table, shorter, lambda now, _: sufficient(now) is None)
    fewer = sufficient(table)
    return (table, best) if fewer is None else eliminate(table, context, fewer)


def _settled_chi2(table: CandidateTable, context: SearchContext, best: CandidateFit) -> float:
    """Return the chi-square from which on a set without one of the effects need not converge: that effect is necessary.

    Only the sets of a large swing take long to converge.
    """
    if not best.has_unexplained_residual:
        return 0.0
    if not context.setting.log.has_large_amplitude:
        return math.inf
    return best.fit.chi2 + MOST_OF_GAP * (baseline_of(table, context).fit.chi2 - best.fit.chi2)


def _forward_step(table: CandidateTable, context: SearchContext, size: int) -> tuple[CandidateTable, CandidateFit]:
    """Fit one more effect beside each of the best sets of a size; return the best set of all if it is significant."""
    before = table.best
    for parent in parents(table, context, size):
        if context.budget.is_exhausted:
            break
        table = fit_by_score(table, context, parent, at_most=MAX_SCORED)
        table = _fit_guesses_and_events(table.start_round(), context, parent)
    table = refine(table, context, size + 1).start_round()
    after = table.best
    return table, after if table.is_significant(before, after) else before


def _fit_guesses_and_events(table: CandidateTable, context: SearchContext, parent: CandidateFit) -> CandidateTable:
    """Fit what is guessed from a parent's residual, and events in windows; a large swing leaves nothing to be found in it."""
    if context.setting.log.has_large_amplitude:
        return table
    table = fit_guessed_effects(table, context, parent).start_round()
    is_found = table.is_explained and table.best is not parent
    return table if is_found else fit_events_in_windows(table, context, parent)


def _eliminate_and_record(
    table: CandidateTable, context: SearchContext, best: CandidateFit
) -> tuple[CandidateTable, CandidateFit]:
    table, remaining = eliminate(table.start_round(), context, best)
    return table.record_move(best, remaining), remaining


@dataclass(frozen=True, slots=True)
class SearchRun:
    """A search on one version of the recordings: as stamped, or at true times where samples were lost."""

    known: KnownModel
    recordings: Recordings
    context: SearchContext
    table: CandidateTable
    validator: Validator
    nominal: CandidateFit
    """The nominal model: only the initial motion is fitted."""
    best: CandidateFit
    lost_fraction: float | None = None
    """Share of the samples that is missing without a trace in the time stamps."""

    @property
    def base(self) -> CandidateFit:
        """The fit of what was found before the search."""
        return baseline_of(self.table, self.context)


def _swap_in_explaining_pair(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Try other effects in place of those of a pair that explains the log."""
    is_pair = len(table.best.values) > len(context.baseline_effects) + 1
    return try_swaps(table, context, table.best)[0] if is_pair and table.is_explained else table


def search(
    known: KnownModel, recordings: Recordings, detected: EffectValues, budget: Budget, on_evaluation: Callable[[], None]
) -> SearchRun | None:
    """Search for missing effects; None where the nominal model cannot be fitted.

    `detected` are effects that the samples show. `on_evaluation` is called at each evaluation of a model.
    """
    run = _begin(known, recordings, detected, budget, on_evaluation)
    if run is None:
        return None
    return _finish(run if run.table.is_explained else _begin_at_true_times(run, detected, on_evaluation))


def _begin(
    known: KnownModel, recordings: Recordings, detected: EffectValues, budget: Budget, on_evaluation: Callable[[], None]
) -> SearchRun | None:
    """Fit the nominal model, the baseline and the persistent effects; None where the nominal model cannot be fitted."""
    context = make_context(known.of_log, recordings.log, budget, on_evaluation)
    validator = Validator(known.model.rig, known.held_out_effects, recordings.selection, budget.processes)
    table = context.fit(CandidateTable(recordings.log), {})
    nominal = table.get({})
    if nominal is None:
        return None
    table, context = fit_baseline(table.start_round(), context, detected, validator)
    table = fit_persistent_effects(table.start_round(), context).start_round()
    return SearchRun(known, recordings, context, table, validator, nominal, table.best)


def _begin_at_true_times(run: SearchRun, detected: EffectValues, on_evaluation: Callable[[], None]) -> SearchRun:
    """Begin once more with the time stamps corrected for lost samples; where none were lost, the run stays as it is."""
    setting, recordings = run.context.setting, run.recordings
    suspects = () if has_event(run.table, run.context) else fit_clock_hypotheses(run.table, run.context)
    lost = next(filter(None, (find_sample_loss(setting, each) for each in suspects)), None)
    if lost is None:
        return run
    held_out = retime_validation(setting, lost, recordings.held_out)
    recordings = replace(recordings, log=lost.retimed(recordings.log), held_out=held_out)
    baseline = {name: run.context.baseline_effects[name] for name in detected if name in run.context.baseline_effects}
    again = _begin(run.known, recordings, baseline, run.context.budget, on_evaluation)
    return run if again is None else replace(again, nominal=run.nominal, lost_fraction=lost.fraction)


def _finish(run: SearchRun) -> SearchRun:
    """Fit single effects, and pairs that are quicker to fit than events; then add effects to the best, if it is significant."""
    context = run.context
    table = fit_bodies(run.table.start_round(), context)
    table = fit_persistent_pairs(table.start_round(), context)
    table = _swap_in_explaining_pair(table.start_round(), context)
    table = _fit_guesses_and_events(table.start_round(), context, baseline_of(table, context))
    table = refine(table, context, len(context.baseline_effects) + 1).start_round()
    base, best = baseline_of(table, context), table.best
    best = best if table.is_significant(base, best) else base
    table, best = grow(table.record_move(base, best), context, best)
    table = fit_coincident_effects(table, context, best)
    return replace(run, context=context.without_eliminated(table, best), table=table.start_round(), best=best)


def fit_coincident_effects(table: CandidateTable, context: SearchContext, best: CandidateFit) -> CandidateTable:
    """Fit coincident effects in place of those of the best set where a length changes."""
    setting = context.setting
    if not any_length_changes((*best.values, *setting.model_effects)):
        return table
    for name, of, values in coincident_effects(best.values, setting.rig.length_m):
        if of not in context.baseline_effects:
            table = context.fit(table, {**best.without(of), name: values}, context.segment_starts(best))
    return table
