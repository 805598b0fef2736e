"""The search: from the nominal model to the best set of effects, one table of candidate fits after the other.

It begins with what needs no search and with persistent effects. Where a clock error is suspected and samples turn out to be lost,
it begins again at true times. Then named steps fit single effects and pairs, and further effects are added to the best.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.crane_inputs import KnownModel
from gateway.twin.reconcile.data.recordings import Recordings
from gateway.twin.reconcile.search.ambiguity import fit_coincident_effects
from gateway.twin.reconcile.search.baseline import fit_baseline
from gateway.twin.reconcile.search.budget import Budget
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext, make_context
from gateway.twin.reconcile.search.events import fit_events_in_windows, has_event, refine
from gateway.twin.reconcile.search.persistent import (
    baseline_of,
    fit_bodies,
    fit_clock_hypotheses,
    fit_guessed_effects,
    fit_persistent_effects,
    fit_persistent_pairs,
)
from gateway.twin.reconcile.search.stepwise_selection import grow, try_swaps
from gateway.twin.reconcile.search.validation import Validator
from gateway.twin.reconcile.timing.sample_loss import find_sample_loss, retime_validation


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


SINGLE_EFFECT_STEPS = (
    SearchStep("fit a heavy rope and effects of the pivot", fit_bodies),
    SearchStep("fit pairs of persistent effects", fit_persistent_pairs),
    SearchStep("swap effects of an explaining pair", _swap_in_explaining_pair),
    SearchStep("fit effects guessed from the residual", _fit_residual_guesses),
    SearchStep("fit events in scanned windows", _fit_windowed_events),
    SearchStep("refine single effects", _refine_single_effects),
)
"""Steps that fit single effects, and pairs that are quicker to fit than events; growth adds further effects to the best."""


def search(
    known: KnownModel,
    recordings: Recordings,
    detected: EffectValues,
    budget: Budget,
    on_evaluation: Callable[[], None],
) -> SearchRun | None:
    """Search for missing effects; None where the nominal model cannot be fitted.

    `detected` are effects that the samples show. `on_evaluation` is called at each evaluation of a model.
    """
    run = _begin(known, recordings, detected, budget, on_evaluation)
    if run is None:
        return None
    return _finish(run if run.table.is_explained else _begin_at_true_times(run, detected, on_evaluation))


def _begin(
    known: KnownModel,
    recordings: Recordings,
    detected: EffectValues,
    budget: Budget,
    on_evaluation: Callable[[], None],
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
    recordings = replace(recordings, log=lost.time_warp.retimed(recordings.log), held_out=held_out)
    baseline = {name: run.context.baseline_effects[name] for name in detected if name in run.context.baseline_effects}
    again = _begin(run.known, recordings, baseline, run.context.budget, on_evaluation)
    return run if again is None else replace(again, nominal=run.nominal, lost_fraction=lost.time_warp.fraction)


def _finish(run: SearchRun) -> SearchRun:
    """Fit single effects and pairs, then add effects to the best if it is significant, else to the baseline."""
    table, context = run.table, run.context
    for step in SINGLE_EFFECT_STEPS:  # the noise inflation is fixed at the beginning of each step
        table = step.run(table.start_round(), context)
    table = table.start_round()
    base, best = baseline_of(table, context), table.best
    best = best if table.is_significant(base, best) else base
    table, best = grow(table.record_move(base, best), context, best)
    table = fit_coincident_effects(table, context, best)
    return replace(run, context=context.without_eliminated(table, best), table=table.start_round(), best=best)
