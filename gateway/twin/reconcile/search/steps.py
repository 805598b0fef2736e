"""The search as named steps: which step follows which, from one table of candidate fits to the next."""

from collections.abc import Callable
from dataclasses import dataclass

from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.events import fit_events_in_windows, refine
from gateway.twin.reconcile.search.persistent import (
    baseline_of,
    fit_ambiguity_partners,
    fit_bodies,
    fit_guessed_effects,
    fit_persistent_effects,
    fit_persistent_pairs,
)
from gateway.twin.reconcile.search.stepwise_selection import try_swaps


@dataclass(frozen=True, slots=True)
class SearchStep:
    """A named step of the search."""

    name: str
    run: Callable[[CandidateTable, SearchContext], CandidateTable]


def _swap_in_explaining_pair(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Try other effects in place of those of a pair that explains the log."""
    is_pair = len(table.best.values) > len(context.baseline_effects) + 1
    return try_swaps(table, context, table.best)[0] if is_pair and table.is_explained else table


def _fit_residual_guesses(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Fit effects that are guessed from the baseline's residual; a large swing leaves nothing to be found in it."""
    if context.setting.large_amplitude:
        return table
    return fit_guessed_effects(table, context, baseline_of(table, context))


def _fit_windowed_events(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Fit events beside the baseline where the scan finds windows."""
    base = baseline_of(table, context)
    if context.setting.large_amplitude or (table.is_explained and table.best is not base):
        return table
    return fit_events_in_windows(table, context, base)


def _refine_single_effects(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Continue the best fits of single effects."""
    return refine(table, context, len(context.baseline_effects) + 1)


PERSISTENT_STEP = SearchStep("fit persistent effects", fit_persistent_effects)
SINGLE_EFFECT_STEPS = (
    SearchStep("fit a heavy rope and effects of the pivot", fit_bodies),
    SearchStep("fit pairs of persistent effects", fit_persistent_pairs),
    SearchStep("swap effects of an explaining pair", _swap_in_explaining_pair),
    SearchStep("fit effects guessed from the residual", _fit_residual_guesses),
    SearchStep("fit events in scanned windows", _fit_windowed_events),
    SearchStep("refine single effects", _refine_single_effects),
    SearchStep("fit ambiguity partners", fit_ambiguity_partners),
)
"""Steps that fit single effects, and pairs that are quicker to fit than events; growth adds further effects to the best."""


def run_steps(steps: tuple[SearchStep, ...], table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Run steps in turn. The noise inflation is fixed at the beginning of each step."""
    for step in steps:
        table = step.run(table.start_round(), context)
    return table.start_round()


def choose_single_effect(table: CandidateTable, context: SearchContext) -> tuple[CandidateTable, CandidateFit]:
    """Return the best fit to grow from, if it is significant; else the baseline."""
    base, best = baseline_of(table, context), table.best
    chosen = best if table.is_significant(base, best) else base
    return table.record_move(base, chosen), chosen
