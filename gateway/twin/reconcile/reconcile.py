"""The workflow of a reconciliation, from a checked recording to the answer.

check_recording -> split_recordings -> detect_in_samples -> take_means
  -> search: nominal model, baseline, persistent effects, once more at true times where samples were lost,
             single effects and pairs, growth
  -> replace_implausible
  -> rank_candidates -> gather_evidence -> decide -> describe_result, with a law where something is left
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Protocol

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.terms import registered_library
from gateway.twin.model import Model
from gateway.twin.reconcile.data.crane_inputs import NO_INPUTS, CraneInputs, KnownModel, registered
from gateway.twin.reconcile.data.data_checks import CheckedRecording, find_lack_of_rest
from gateway.twin.reconcile.data.observations import (
    Recordings,
    find_lack_of_test,
    samples_per_mean,
    split_recordings,
    take_means,
)
from gateway.twin.reconcile.decision.evidence import RankedCandidate, gather_evidence, rank_candidates
from gateway.twin.reconcile.decision.identifiability import contributions, is_beyond_parts, replace_implausible
from gateway.twin.reconcile.decision.verdict import as_best_so_far, decide
from gateway.twin.reconcile.equation import find_law
from gateway.twin.reconcile.output.result import AVERAGED, Reconciliation
from gateway.twin.reconcile.output.result_builder import SearchOutcome, build_result, unusable_result
from gateway.twin.reconcile.search.context import Budget
from gateway.twin.reconcile.search.search import SearchRun, search
from gateway.twin.reconcile.search.steps import detect_in_samples
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES


class ReportProgress(Protocol):
    """Is called at each step of the work."""

    def __call__(self, stage: str, share: float | None = None) -> None:
        """Take the stage, and the share of its largest work that is done; None: not known."""


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
    run = search(known, recordings, detected, budget, lambda: tick("search", budget.spent_share))
    if run is None:
        return unusable_result(known.model, log, "the nominal model cannot be fitted")
    tick("validation")
    table, best = run.table, run.best
    table, best = replace_implausible(table.start_round(), run.context, run.validator, best)
    run = replace(run, table=table.start_round(), best=best)
    outcome = _decide(run, random)
    return describe_result(outcome, log.counts if averaged == 1 else {**log.counts, AVERAGED: averaged}, random)


def _decide(run: SearchRun, random: np.random.Generator) -> SearchOutcome:
    """Rank the sets near the best by all evidence and decide between them; of a search that was ended, take the best as it is."""
    context, table, validator = run.context, run.table, run.validator
    ended_early = context.budget.is_over()
    if ended_early:
        fits = {each.names: each for each in (run.nominal, run.base, run.best)}
        table = replace(table, fits=fits, moves=tuple(move for move in table.moves if move.names in fits))
    ranked, base = rank_candidates(table, run.best, run.base.names, validator)
    best = ranked[0]
    evidence = gather_evidence(
        run,
        ranked,
        base,
        improves_selection=_is_supported_by_selection(run, best, base, random),
        beyond_parts=frozenset(name for name in best.names if is_beyond_parts(name, best.candidate, context)),
    )
    decision = decide(evidence, run.recordings.log, cache(lambda: contributions(context, validator, best.candidate)))
    if ended_early:
        decision = as_best_so_far(decision)
    return SearchOutcome(replace(run, table=table), ranked, decision, ended_early)


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


def describe_result(found: SearchOutcome, counts: Mapping[str, int], random: np.random.Generator) -> Reconciliation:
    """Return the result of a search, with the law of what is left where something is and the test part does not refute it."""
    if not found.decision.leaves_remainder or found.run.context.budget.is_over():
        return build_result(found, counts, random)
    with registered_library():
        described = _describe(found, random)
        result = build_result(described, counts, random)
        closed_percent = None if result.law is None else result.law.closed_test_percent
        is_refuted = closed_percent is not None and closed_percent < 0  # then it describes nothing
        return build_result(found, counts, random) if is_refuted else result


def _describe(found: SearchOutcome, random: np.random.Generator) -> SearchOutcome:
    """Seek a law beside what is certain, which takes the place of the rest of the best attempt where it has more evidence."""
    decision, attempt, run = found.decision, found.decision.model, found.run
    certain = {name: each for name, each in attempt.candidate.values.items() if name in decision.known}
    base = run.table.get(certain) or run.context.fit_apart(certain)
    try:
        law = None if base is None else find_law(run.context, base, run.validator, random)
    except INTEGRATION_FAILURES:  # a base that diverges on the held-out recording describes nothing
        law = None
    if law is None:
        return found
    table = replace(run.table, noise_inflation=law.noise_inflation)
    by_law = table.evidence(law.candidate, law.after.fit.chi2)
    if by_law > table.evidence(attempt.candidate, attempt.validation.fit.chi2):
        return found
    model = RankedCandidate(law.candidate, law.after, run.table.bic(law.candidate), 0.0)
    return replace(found, decision=replace(decision, model=model), law=law)
