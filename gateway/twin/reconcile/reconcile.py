"""The workflow: check, split, search, accept, validate, decide, report."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.clock import SampleLoss
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.crane_inputs import NO_INPUTS, CraneInputs, KnownModel, registered
from gateway.twin.reconcile.data.data_checks import CheckedRecording, find_lack_of_rest
from gateway.twin.reconcile.data.recordings import Recordings, find_lack_of_test, split_recordings
from gateway.twin.reconcile.data.sample_means import samples_per_mean, take_means
from gateway.twin.reconcile.decision.evidence import gather_evidence
from gateway.twin.reconcile.decision.ranking import RankedCandidate, rank_candidates, rivals_of
from gateway.twin.reconcile.decision.verdict import as_best_so_far, decide
from gateway.twin.reconcile.equation.remainder import describe_result
from gateway.twin.reconcile.output.result import AVERAGED, Reconciliation
from gateway.twin.reconcile.output.result_builder import SearchOutcome, unusable_result
from gateway.twin.reconcile.residual.isolability import indistinguishable_pairs
from gateway.twin.reconcile.search.ambiguity import indistinguishable, is_beyond_parts, replace_implausible
from gateway.twin.reconcile.search.baseline import detect_in_samples, fit_baseline
from gateway.twin.reconcile.search.budget import Budget
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.coincident import fit_coincident_effects
from gateway.twin.reconcile.search.context import SearchContext, make_context
from gateway.twin.reconcile.search.events import has_event
from gateway.twin.reconcile.search.persistent import baseline_of, fit_clock_hypothesis
from gateway.twin.reconcile.search.steps import (
    PERSISTENT_STEP,
    SINGLE_EFFECT_STEPS,
    choose_single_effect,
    run_steps,
)
from gateway.twin.reconcile.search.stepwise_selection import grow
from gateway.twin.reconcile.search.usual_causes import fit_usual_causes
from gateway.twin.reconcile.search.validation_cache import Validator
from gateway.twin.reconcile.timing.sample_loss import find_sample_loss, retime_validation


class ReportProgress(Protocol):
    """Is called at each step of the work."""

    def __call__(self, stage: str, share: float | None = None) -> None:
        """Take the stage, and the share of its largest work that is done; None: not known."""


@dataclass(frozen=True, slots=True)
class SearchRun:
    """A search on one version of the recordings: as stamped, or at true times where samples were lost."""

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


def reconcile(
    model: Model,
    log: CheckedRecording,
    held_out: CheckedRecording | None,
    *,
    inputs: CraneInputs = NO_INPUTS,
    held_out_inputs: CraneInputs = NO_INPUTS,
    seed: int = 0,
    processes: int = 1,
    tick: ReportProgress = lambda _stage, _share=None: None,
    is_over: Callable[[], bool] = lambda: False,
) -> Reconciliation:
    """Find what the model lacks; `tick` is called with the stage at each step of a fit.

    Once `is_over`, the search ends as soon as the nominal model is fitted, and the answer is the best so far.

    `inputs` and `held_out_inputs`: what the crane did in the log and in a second recording, which is then part of the model.
    `processes` share the fits; the answer does not depend on their number.
    """
    fault = log.fault or (None if held_out is None or held_out.fault is None else f"held-out: {held_out.fault}")
    if fault is not None or log.observations is None:
        return unusable_result(model, log, fault or "no samples")
    second = None if held_out is None else held_out.observations
    known = KnownModel(model, inputs, inputs if second is None else held_out_inputs)
    recordings = split_recordings(
        inputs.leave_out(log.observations),
        None if second is None else held_out_inputs.leave_out(second),
        model.rig.small_swing_period_s,
    )
    if inputs.found or held_out_inputs.found:  # without inputs nothing was left out
        fault = find_lack_of_rest(model.rig, recordings.log, recordings.held_out)
        if fault is not None:
            return unusable_result(model, log, fault)
    if (fault := find_lack_of_test(recordings)) is not None:
        return unusable_result(model, log, fault)
    with registered(inputs, held_out_inputs):
        return _reconcile(known, recordings, log, seed, Budget(processes=processes, is_over=is_over), tick)


def _reconcile(
    known: KnownModel, recordings: Recordings, log: CheckedRecording, seed: int, budget: Budget, tick: ReportProgress
) -> Reconciliation:
    recordings, detected = detect_in_samples(recordings, log.rows_per_reading, known.model.effects)
    averaged = 1 if detected else samples_per_mean(recordings)  # steps, limits and repeats are not those of a mean
    recordings = take_means(recordings, averaged)
    random = np.random.default_rng(seed)
    tick("baseline")
    run = _search(known, recordings, detected, budget, tick)
    if run is None:
        return unusable_result(known.model, log, "the nominal model cannot be fitted")
    tick("validation")
    table, best = run.table, run.best
    if best.has_unexplained_residual and not run.context.setting.crane_inputs:
        tick("usual causes")
        table, best = fit_usual_causes(table.start_round(), run.context, best, run.validator)
    table, best = replace_implausible(table.start_round(), run.context, run.validator, best)
    run = replace(run, table=table.start_round(), best=best)
    outcome = _decide(known, run, random)
    return describe_result(outcome, log.counts if averaged == 1 else {**log.counts, AVERAGED: averaged}, random)


def _search(
    known: KnownModel, recordings: Recordings, detected: EffectValues, budget: Budget, tick: ReportProgress
) -> SearchRun | None:
    """Search for missing effects; once more at true times where samples turn out to be lost."""
    run = _begin(known, recordings, detected, budget, tick)
    if run is None:
        return None
    suspect = fit_clock_hypothesis(run.table, run.context)
    if suspect is not None and not run.table.is_explained and not has_event(run.table, run.context):
        retimed = _search_at_true_times(known, run, suspect, detected, tick)
        if retimed is not None:
            return retimed
    return _finish(run)


def _begin(
    known: KnownModel, recordings: Recordings, detected: EffectValues, budget: Budget, tick: ReportProgress
) -> SearchRun | None:
    """Fit the nominal model, the baseline and the persistent effects; None where the nominal model cannot be fitted."""
    context = make_context(known.of_log, recordings.log, budget, lambda: tick("search", budget.spent_share))
    validator = Validator(known.model.rig, known.held_out_effects, recordings.selection, budget.processes)
    table = context.fit(CandidateTable(recordings.log), {})
    nominal = table.get({})
    if nominal is None:
        return None
    table, context = fit_baseline(table.start_round(), context, detected, validator)
    table = run_steps((PERSISTENT_STEP,), table, context)
    return SearchRun(recordings, context, table, validator, nominal, table.best)


def _finish(run: SearchRun) -> SearchRun:
    """Fit single effects and pairs, then add effects to the best."""
    table = run_steps(SINGLE_EFFECT_STEPS, run.table, run.context)
    table, best = choose_single_effect(table, run.context)
    table, best = grow(table, run.context, best)
    table = fit_coincident_effects(table, run.context, best)
    return replace(run, context=run.context.without_eliminated(table, best), table=table.start_round(), best=best)


def _search_at_true_times(
    known: KnownModel, run: SearchRun, suspect: CandidateFit, detected: EffectValues, tick: ReportProgress
) -> SearchRun | None:
    """Search once more with the time stamps corrected for lost samples; None where no samples were lost."""
    setting, recordings = run.context.setting, run.recordings
    lost = find_sample_loss(setting, suspect)
    if lost is None:
        return None
    held_out = retime_validation(setting, lost, recordings.held_out)
    recordings = replace(recordings, log=lost.time_warp.retimed(recordings.log), held_out=held_out)
    baseline = {name: run.context.baseline_effects[name] for name in detected if name in run.context.baseline_effects}
    again = _begin(known, recordings, baseline, run.context.budget, tick)
    if again is None:
        return None
    again = replace(again, nominal=run.nominal, lost_fraction=lost.time_warp.fraction)
    return _finish(again)


def _decide(known: KnownModel, run: SearchRun, random: np.random.Generator) -> SearchOutcome:
    """Rank the sets near the best by all evidence and decide between them; of a search that was ended, take the best as it is."""
    context, table, validator = run.context, run.table, run.validator
    ended_early = context.budget.is_over()
    if ended_early:
        fits = {each.names: each for each in (run.nominal, run.base, run.best)}
        table = replace(table, fits=fits, moves=tuple(move for move in table.moves if move.names in fits))
    pairs = indistinguishable_pairs(context.signatures(run.base).of)
    ranked, base = rank_candidates(table, run.best, run.base.names, validator, pairs)
    best = ranked[0]
    evidence = gather_evidence(
        best,
        base,
        RankedCandidate(run.nominal, validator.evaluate(run.nominal), 0.0, 0.0),
        rivals_of(ranked, pairs),
        run.recordings.log,
        validator.selection,
        run.table.fits,
        frozenset() if run.lost_fraction is None else frozenset({SampleLoss.name}),
        improves_selection=_is_supported_by_selection(run, best, base, random),
        beyond_parts=frozenset(name for name in best.names if is_beyond_parts(name, best.candidate, context)),
    )
    decision = decide(evidence, run.recordings.log, partial(indistinguishable, context, validator, best.candidate))
    if ended_early:
        decision = as_best_so_far(decision)
    return SearchOutcome(
        model=known.model,
        recordings=run.recordings,
        context=context,
        table=table,
        validator=validator,
        nominal=run.nominal,
        base=run.base,
        ranked=ranked,
        decision=decision,
        lost_fraction=run.lost_fraction,
        inputs=known.inputs.found,
        held_out_inputs=() if run.recordings.last_third else known.held_out_inputs.found,
        ended_early=ended_early,
    )


def _is_supported_by_selection(
    run: SearchRun, best: RankedCandidate, base: RankedCandidate, random: np.random.Generator
) -> bool:
    """Whether the best set leaves less on the selection part than the baseline, or adds only events that are not in it."""
    if best.names == base.names:
        return False
    selection, added = run.validator.selection, best.names - base.names
    intervals_s = [EFFECTS[name].interval_s(best.candidate.values[name]) for name in added]
    if all(interval is not None and interval[1] < selection.offset_s for interval in intervals_s):
        return True
    return run.validator.is_improved(base.validation, best.validation, random)
