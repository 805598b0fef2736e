"""The whole workflow: load, fit the nuisances, locate, rank, search, judge on held-out data, answer."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.clock import ClockDrift, SampleLoss
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.sensor_output import Quantization
from gateway.twin.model import Model
from gateway.twin.reconcile.data.artefact_detectors import quantised_mean
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations, Recordings
from gateway.twin.reconcile.decision.ambiguity_groups import is_superset_of_best
from gateway.twin.reconcile.decision.verdict import MIN_EVIDENCE_MARGIN, RankedCandidate, decide
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.validation import evaluate_on_validation
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.result_builder import SearchOutcome, build_result
from gateway.twin.reconcile.residual.isolability import indistinguishable_pairs
from gateway.twin.reconcile.residual.residual_tests import has_excess
from gateway.twin.reconcile.residual.surrogate_test import normal_score, null_threshold
from gateway.twin.reconcile.search.baseline import (
    MIN_REPEATED_GAIN,
    detect_in_samples,
    initialise_baseline,
    prepare_recordings,
)
from gateway.twin.reconcile.search.candidate_fits import CandidateFit
from gateway.twin.reconcile.search.search import Search
from gateway.twin.reconcile.search.validation_search import extend_by_validation_residual
from gateway.twin.reconcile.timing.sample_loss import find_sample_loss, retime_validation

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
MAX_VALIDATED = 4
VALIDATED_MARGIN = 5.0
"""Sets within this many times `RIVAL` of the best on the log are judged on held-out data."""


def reconcile(
    model: Model,
    log: CheckedRecording,
    held_out: CheckedRecording | None,
    *,
    seed: int = 0,
    tick: Callable[[str], None] = lambda _stage: None,
) -> Reconciliation:
    """Find what is missing; `tick` is told of each stage and each step of a fit."""
    fault = log.fault or (None if held_out is None or held_out.fault is None else f"held-out: {held_out.fault}")
    if fault is not None or log.observations is None:
        return unusable_result(model, log, fault or "no samples")
    recordings = prepare_recordings(log.observations, None if held_out is None else held_out.observations)
    recordings, always = detect_in_samples(recordings)
    rng = np.random.default_rng(seed)
    tick("baseline")
    believed = _search(model, recordings.log, {}, tick)
    start = believed.fit_candidate({})
    if start is None:
        return unusable_result(model, log, "the model as believed cannot be fitted")
    search, base, recordings, lost = _singles(believed, start, recordings, always)
    best = search.run(base, search.best())
    wandering = (
        lost is None and not search.has_event(base) and _clock_rate_is_suspect(search, best, recordings.held_out)
    )
    again = _at_true_times(search, best, recordings, always) if wandering else None
    if again is not None:
        search, base, recordings, lost = again
        best = search.run(base, search.best())
    if not (_exceeds_null(search, base, best, rng) and _exceeds_quantisation(search, base, best)):
        best = base
    tick("held-out")
    best = extend_by_validation_residual(search, best, recordings.held_out, rng)
    contenders, base_contender = validate_candidates(search, best, recordings, frozenset(base.values))
    seen = frozenset({SampleLoss.name} if lost is not None else ())
    answer = decide(
        contenders,
        base_contender,
        recordings.log,
        recordings.held_out,
        frozenset(base.values),
        seen,
        search.candidates,
        rng,
        frozenset() if search.signatures is None else indistinguishable_pairs(search.signatures.of),
    )
    before = evaluate_on_validation(model.rig, model.effects, recordings.held_out_as_stamped)
    findings = SearchOutcome(model, recordings, search, start, before, contenders, answer, lost)
    return build_result(findings, log.counts, rng)


def _search(model: Model, log: Observations, always: Values, tick: Callable[[str], None]) -> Search:
    return Search(FitContext(model.rig, model.effects, log, lambda: tick("search")), always)


def _singles(
    believed: Search, start: CandidateFit, recordings: Recordings, always: Values
) -> tuple[Search, CandidateFit, Recordings, float | None]:
    """Single effects beside what the readings themselves show; again at true times where samples were lost."""
    search, base = initialise_baseline(believed, start, always, recordings.held_out)
    slow_clock = _clock_rate_hypothesis(search, search.fit_persistent_effects(base))
    found = None
    if not search.has_event(base) and slow_clock is not None and search.best().has_unexplained_residual:
        found = _at_true_times(search, slow_clock, recordings, always)
    if found is not None:
        return found
    search.fit_single_effects(base)
    return search, base, recordings, None


def _clock_rate_hypothesis(search: Search, best: CandidateFit) -> CandidateFit | None:
    """Beside what is always there; where that hides the clock, beside the best that acts all the time.

    The latter is for a look only: the search does not begin with a pair.
    """
    alone = search.candidates.get(frozenset({*search.baseline_effects, ClockDrift.name}))
    if alone is not None or not best.has_unexplained_residual:
        return alone
    return Search(search.setting, search.baseline_effects).fit_candidate({**best.values, ClockDrift.name: {}})


def _clock_rate_is_suspect(search: Search, best: CandidateFit, held_out: Observations) -> bool:
    """With a clock that does not explain both recordings."""
    if ClockDrift.name not in best.values:
        return False
    rig, values = search.setting.rig, {**search.setting.model_effects, **best.values}
    return best.has_unexplained_residual or has_excess(held_out, evaluate_on_validation(rig, values, held_out).fit)


def _at_true_times(
    search: Search, slow_clock: CandidateFit, recordings: Recordings, always: Values
) -> tuple[Search, CandidateFit, Recordings, float | None] | None:
    """Single effects once more where samples turn out to be lost; None where none are."""
    lost = find_sample_loss(search.setting, slow_clock)
    if lost is None:
        return None
    held_out = retime_validation(search.setting, lost, recordings.held_out)
    recordings = replace(recordings, log=lost.walk.retimed(recordings.log), held_out=held_out)
    again = Search(replace(search.setting, log=recordings.log), {})
    start = again.fit_candidate({})
    if start is None:
        return None
    search, base = initialise_baseline(again, start, {name: search.baseline_effects[name] for name in always}, held_out)
    search.fit_persistent_effects(base)
    search.fit_single_effects(base)
    return search, base, recordings, lost.walk.fraction


def _exceeds_null(search: Search, base: CandidateFit, best: CandidateFit, rng: np.random.Generator) -> bool:
    """More than noise of the residual's own colour reaches with any effect."""
    if best is base or search.signatures is None:
        return False
    residual = search.setting.log.residual_sigma(best.fit.force_g)
    reached = normal_score(base.fit.chi2 - best.fit.chi2, max(1, best.parameters - base.parameters))
    return reached > null_threshold(search.signatures.of, residual, rng)


def _exceeds_quantisation(search: Search, base: CandidateFit, best: CandidateFit) -> bool:
    """With readings in coarse steps, the gain holds against the mean of the steps: else it only imitates them."""
    if Quantization.name not in base.values or best is base:
        return True
    log, rig = search.setting.log, search.setting.rig
    step_g = float(np.asarray(base.values[Quantization.name]["lsb_g"]))

    def stepped(attempt: CandidateFit) -> float:
        return log.reduced_chi2(quantised_mean(attempt.fit.force_g, step_g, np.array(rig.noise_g)))

    return stepped(base) - stepped(best) > MIN_REPEATED_GAIN * (base.reduced_chi2 - best.reduced_chi2)


def validate_candidates(
    search: Search, best: CandidateFit, recordings: Recordings, always: frozenset[str]
) -> tuple[list[RankedCandidate], RankedCandidate]:
    """The sets near the best on the log, judged on the held-out recording, best first; and the base."""
    setting, unit = search.setting, search.noise_inflation()
    least = search.bic(best, unit)
    ranked = sorted(search.candidates.values(), key=lambda a: search.bic(a, unit))
    near = [
        a
        for a in ranked
        if not is_superset_of_best(a.names, best.names)
        and always <= a.names
        and search.bic(a, unit) < least + VALIDATED_MARGIN * MIN_EVIDENCE_MARGIN
    ]

    def contender(attempt: CandidateFit) -> RankedCandidate:
        found = evaluate_on_validation(setting.rig, {**setting.model_effects, **attempt.values}, recordings.held_out)
        return RankedCandidate(attempt, found, search.bic(attempt, unit), 0.0)

    found = [contender(a) for a in [best, *near[: MAX_VALIDATED - 1]]]
    start = contender(search.candidates[always])
    evidence = [c.bic + c.validation.fit.chi2 / unit for c in found]
    order = np.argsort(evidence)
    return [replace(found[i], evidence_deficit=evidence[i] - evidence[order[0]]) for i in order], start


def unusable_result(model: Model, log: CheckedRecording, fault: str) -> Reconciliation:
    """The answer where nothing can be said."""
    return Reconciliation(
        verdict="data_unusable",
        reason=fault,
        rig=model.rig,
        effects=(),
        candidates=(),
        split_by=None,
        disagreement=(),
        gap=None,
        residual=None,
        steps=(),
        scores=(),
        ranking=(),
        confusable=(),
        equations_before=(),
        equations_after=(),
        log=None,
        held_out=None,
        held_out_is_last_third=False,
        refitted_on_held_out=(),
        counts=log.counts,
        model=model.effects,
    )
