"""The answer in full: curves, gap, intervals, ranking, equations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.stats import NORMAL_975
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.clock import SampleLoss
from gateway.twin.effects.parameter import Parameter, Value
from gateway.twin.effects.sensor_output import Quantization
from gateway.twin.model import Model
from gateway.twin.reconcile.data.artefact_detectors import quantised_mean
from gateway.twin.reconcile.data.observations import Recordings
from gateway.twin.reconcile.decision.ambiguity_groups import discriminating_experiment
from gateway.twin.reconcile.decision.verdict import MIN_EVIDENCE_MARGIN, Decision, RankedCandidate
from gateway.twin.reconcile.fit.validation import ValidationFit, block_bootstrap_gain, evaluate_on_validation
from gateway.twin.reconcile.output.result import (
    Candidate,
    Curves,
    Estimate,
    Gap,
    NamedEffect,
    Reconciliation,
    ScoreTestResult,
    Step,
)
from gateway.twin.reconcile.residual.isolability import confusable
from gateway.twin.reconcile.residual.localisation import localise_residual
from gateway.twin.reconcile.residual.whiteness import analyse_residual
from gateway.twin.reconcile.search.candidate_fits import MIN_SCORE_STATISTIC, CandidateFit
from gateway.twin.reconcile.search.search import Search

Array = NDArray[np.float64]
MAX_RANKED = 12
STEP_ITERATIONS = 6
BASE_EQUATIONS = (
    "n″ = (I − n nᵀ)(g − a_p + F/m)/L − 2 (L′/L) n′ − |n′|² n",
    "f = a_p + r n″ + 2 r′ n′ + r″ n − g, in the housing's axes",
)


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """All that the answer is made from."""

    model: Model
    recordings: Recordings
    search: Search
    believed: CandidateFit
    """The model as believed, only the nuisances fitted."""
    believed_held_out: ValidationFit
    contenders: list[RankedCandidate]
    answer: Decision
    lost: float | None
    """Part of the samples that is missing without a trace."""


def build_result(found: SearchOutcome, counts: Mapping[str, int], rng: np.random.Generator) -> Reconciliation:
    """Everything in one record."""
    answer, rig = found.answer, found.model.rig
    log_curves, held_curves = _curves(found, held_out=False), _curves(found, held_out=True)
    sigma = _sigma(log_curves)
    final = found.answer.model
    return Reconciliation(
        verdict=answer.verdict,
        reason=answer.reason,
        rig=rig,
        effects=tuple(
            _sample_loss(found) if name == SampleLoss.name else _named(name, final, found) for name in answer.named
        ),
        candidates=answer.candidates,
        split_by=discriminating_experiment(frozenset(answer.candidates)) if answer.candidates else None,
        disagreement=localise_residual(found.recordings.log.time_s, sigma[0]),
        gap=_gap(log_curves, held_curves, rng),
        residual=analyse_residual(found.recordings.log.time_s, *sigma, log_curves.noise_g),
        steps=_steps(found),
        scores=_scores(found),
        ranking=_ranking(found),
        confusable=() if found.search.signatures is None else confusable(found.search.signatures.of),
        equations_before=(*BASE_EQUATIONS, *_equations(found.model.effects)),
        equations_after=(*BASE_EQUATIONS, *_equations(_final_model(found))),
        log=log_curves,
        held_out=held_curves,
        held_out_is_last_third=found.recordings.last_third,
        refitted_on_held_out=final.validation.refitted_parameters,
        counts=counts,
        model=_final_model(found),
    )


def _final_model(found: SearchOutcome) -> Mapping[str, Mapping[str, Value]]:
    lost: dict[str, Mapping[str, Value]] = {} if found.lost is None else {SampleLoss.name: {"fraction": found.lost}}
    return {**found.model.effects, **found.answer.model.candidate.values, **lost}


def _quantised(found: SearchOutcome, values: Mapping[str, Mapping[str, Value]], force_g: Array) -> Array:
    """With the steps of the readings, where the model has them."""
    if Quantization.name not in values:
        return force_g
    step_g = float(np.asarray(values[Quantization.name]["lsb_g"]))
    return quantised_mean(force_g, step_g, np.array(found.model.rig.noise_g))


def _curves(found: SearchOutcome, *, held_out: bool) -> Curves:
    """On the log at its true times; on held-out data as stamped, since which samples are lost there cannot be foretold."""
    observations = found.recordings.held_out_as_stamped if held_out else found.recordings.log
    final = found.answer.model
    after = final.validation.fit.force_g if held_out else final.candidate.fit.force_g
    if held_out and found.lost is not None:
        values = {**found.model.effects, **final.candidate.values, SampleLoss.name: {"fraction": found.lost}}
        after = evaluate_on_validation(found.model.rig, values, observations).fit.force_g
    before = found.believed_held_out.fit.force_g if held_out else found.believed.fit.force_g
    return Curves(
        observations.time_s,
        observations.force_g,
        before,
        _quantised(found, final.candidate.values, after),
        observations.used,
        np.array(found.model.rig.noise_g),
        observations.offset_s,
    )


def _sigma(curves: Curves) -> tuple[Array, Array]:
    weight = curves.used[:, None] / curves.noise_g
    return curves.residual_before_g * weight, curves.residual_after_g * weight


def _gap(log: Curves, held_out: Curves, rng: np.random.Generator) -> Gap:
    def reduced(curves: Curves) -> tuple[float, float]:
        before, after = _sigma(curves)
        count = 3 * int(curves.used.sum())
        return float((before**2).sum() / count), float((after**2).sum() / count)

    interval = block_bootstrap_gain(*_sigma(held_out), held_out.time_s, rng)
    (before_log, after_log), (before_held, after_held) = reduced(log), reduced(held_out)
    return Gap(before_log, before_held, after_log, after_held, interval)


def _named(name: str, final: RankedCandidate, found: SearchOutcome) -> NamedEffect:
    effect = EFFECTS[name]
    values = final.candidate.values[name]
    simulator = found.search.setting.simulator(tuple(final.candidate.values))
    fit = final.candidate.fit
    sigma = np.zeros(len(simulator.parameters))
    sigma[fit.free] = np.sqrt(np.maximum(np.diag(fit.covariance()), 0.0) * found.search.noise_inflation())
    of = {
        p.name: [
            s
            for s, slot in zip(sigma, simulator.parameters, strict=True)
            if (slot.effect, slot.parameter) == (name, p.name)
        ]
        for p in effect.parameters
    }
    parameters = {p.name: _estimate(p, values[p.name], of[p.name]) for p in effect.parameters}
    return NamedEffect(name, effect.explains, effect.equation, parameters, effect.interval_s(values))


def _sample_loss(found: SearchOutcome) -> NamedEffect:
    effect = EFFECTS[SampleLoss.name]
    fraction = found.lost or 0.0
    count = len(found.recordings.log.time_s)
    sigma = float(np.sqrt(fraction * (1 - fraction) / count))  # binomial
    estimate = _estimate(effect.parameters[0], fraction, [sigma])
    return NamedEffect(effect.name, effect.explains, effect.equation, {"fraction": estimate}, None)


def _estimate(parameter: Parameter, value: Value, sigma: Sequence[float]) -> Estimate:
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    spread = NORMAL_975 * (np.array(sigma) if len(sigma) == len(numbers) else np.zeros(len(numbers)))
    low, high = np.maximum(numbers - spread, parameter.lower), np.minimum(numbers + spread, parameter.upper)
    resting = bool(((numbers <= parameter.lower) | (numbers >= parameter.upper)).any())
    if parameter.components:
        ci95: tuple[Value, Value] = (tuple(map(float, low)), tuple(map(float, high)))
        return Estimate(tuple(map(float, numbers)), ci95, parameter.unit, parameter.meaning, not resting)
    return Estimate(float(numbers[0]), (float(low[0]), float(high[0])), parameter.unit, parameter.meaning, not resting)


def _steps(found: SearchOutcome) -> tuple[Step, ...]:
    """Each with its gap on held-out data; sets that were judged for the verdict are not judged again."""
    known = {c.names: c.validation.reduced_chi2 for c in found.contenders}
    steps = []
    for s in found.search.history:
        if s.names not in known:
            values = {**found.model.effects, **found.search.candidates[s.names].values}
            known[s.names] = evaluate_on_validation(
                found.model.rig, values, found.recordings.held_out, STEP_ITERATIONS
            ).reduced_chi2
        added, dropped, names = (tuple(sorted(each)) for each in (s.added, s.dropped, s.names))
        steps.append(Step(added, dropped, names, s.reduced, known[s.names], s.bic))
    return tuple(steps)


def _scores(found: SearchOutcome) -> tuple[ScoreTestResult, ...]:
    unit, excess = found.search.noise_inflation(), max(found.believed.fit.chi2 - found.recordings.log.n_values, 1.0)
    drops = sorted(found.search.scores.items(), key=lambda each: -each[1])
    return tuple(
        ScoreTestResult(name, min(1.0, drop / excess), drop / unit, MIN_SCORE_STATISTIC) for name, drop in drops
    )


def _ranking(found: SearchOutcome) -> tuple[Candidate, ...]:
    search, unit = found.search, found.search.noise_inflation()
    judged = {c.names: c for c in found.contenders}
    best = min(c.bic for c in found.contenders)
    ranked = sorted(search.candidates.values(), key=lambda a: search.bic(a, unit))[:MAX_RANKED]
    result = []
    for attempt in ranked:
        contender = judged.get(attempt.names)
        bic = search.bic(attempt, unit)
        behind = max(0.0, bic - best) if contender is None else contender.evidence_deficit
        held = None if contender is None else contender.validation.reduced_chi2
        rival = contender is not None and 0 <= behind < MIN_EVIDENCE_MARGIN
        result.append(Candidate(tuple(sorted(attempt.names)), attempt.reduced_chi2, held, bic, behind, rival))
    return tuple(sorted(result, key=lambda c: c.behind))


def _equations(effects: Mapping[str, object]) -> tuple[str, ...]:
    return tuple(f"{name}: {effect.equation}" for name, effect in EFFECTS.items() if name in effects)
