"""The result of a reconciliation in full: curves, gap, intervals, ranking, equations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.stats import NORMAL_975
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.clock import SampleLoss
from gateway.twin.effects.parameter import Parameter, Value
from gateway.twin.effects.plausibility import excess, limit_of, rests_at_edge
from gateway.twin.effects.sensor_output import Quantization
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.artefact_detectors import quantised_mean
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.recordings import Recordings, selection_part, test_part
from gateway.twin.reconcile.decision.ranking import MIN_EVIDENCE_MARGIN, RankedCandidate
from gateway.twin.reconcile.decision.verdict import Decision
from gateway.twin.reconcile.equation.selection import FoundLaw
from gateway.twin.reconcile.fit.coloured_covariance import coloured_covariance
from gateway.twin.reconcile.fit.validation import block_bootstrap_gain, evaluate_on_validation
from gateway.twin.reconcile.output.data_parts import list_data_parts
from gateway.twin.reconcile.output.equivalents import find_equivalents
from gateway.twin.reconcile.output.estimates import Estimate, NamedEffect
from gateway.twin.reconcile.output.result import (
    Candidate,
    Curves,
    Gap,
    Reconciliation,
    ScoreTestResult,
    Step,
)
from gateway.twin.reconcile.residual.isolability import confusable
from gateway.twin.reconcile.residual.localisation import localise_residual
from gateway.twin.reconcile.residual.remainder_of_motion import describe_remainder, name_multiples
from gateway.twin.reconcile.residual.whiteness import analyse_residual
from gateway.twin.reconcile.search.candidates import MIN_SCORE_STATISTIC, CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.validation_cache import Validator

Array = NDArray[np.float64]
MAX_RANKED = 12
BASE_EQUATIONS = (
    "n″ = (I − n nᵀ)(g − a_p + F/m)/L − 2 (L′/L) n′ − |n′|² n",
    "f = a_p + r n″ + 2 r′ n′ + r″ n − g, in the housing's axes",
)


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """All that the result is made from."""

    model: Model
    recordings: Recordings
    context: SearchContext
    table: CandidateTable
    validator: Validator
    nominal: CandidateFit
    """The nominal model: only the initial motion is fitted."""
    base: CandidateFit
    """The fit of what was found before the search."""
    ranked: list[RankedCandidate]
    decision: Decision
    lost_fraction: float | None
    """Share of the samples that is missing without a trace in the time stamps."""
    inputs: tuple[EstimatedInput, ...]
    held_out_inputs: tuple[EstimatedInput, ...]
    """What the crane did in the log, and in a second recording."""
    ended_early: bool
    """The search was ended before it had tried all that it would have."""
    law: FoundLaw | None = None
    """The law of what no effect explains; part of the decision's model."""


def build_result(found: SearchOutcome, counts: Mapping[str, int], random: np.random.Generator) -> Reconciliation:
    """Put everything into one record."""
    decision, recordings, final = found.decision, found.recordings, found.decision.model
    log_curves, held_curves = _log_curves(found), _held_out_curves(found)
    sigma = _sigma(log_curves)
    return Reconciliation(
        verdict=decision.verdict,
        reason=decision.text,
        reason_code=decision.reason.name.lower(),
        parts=list_data_parts(recordings),
        rig=found.model.rig,
        effects=tuple(
            _sample_loss(found) if name == SampleLoss.name else named_effect(name, final, found)
            for name in decision.named
        ),
        candidates=decision.candidates,
        also_one_of=decision.also_one_of,
        leaves_remainder=decision.leaves_remainder,
        split_by=_discriminating_experiments(
            (*decision.candidates, *(n for group in decision.also_one_of for n in group))
        ),
        disagreement=localise_residual(recordings.log.time_s, sigma[0]),
        gap=_gap(log_curves, held_curves, test_part(recordings.held_out_as_stamped, recordings.block_s).used, random),
        residual=name_multiples(
            analyse_residual(recordings.log.time_s, *sigma, log_curves.noise_g), log_curves, found.model.rig
        ),
        remainder=describe_remainder(log_curves, found.model.rig),
        steps=_steps(found),
        scores=_scores(found),
        ranking=_ranking(found),
        confusable=confusable(found.context.signatures(found.base).of),
        equations_before=(*BASE_EQUATIONS, *_equations(found.model.effects)),
        equations_after=(*BASE_EQUATIONS, *_equations(_final_model(found))),
        log=log_curves,
        held_out=held_curves,
        held_out_is_last_third=recordings.last_third,
        refitted_on_held_out=final.validation.refitted_parameters,
        counts=counts,
        model=_final_model(found),
        inputs=found.inputs,
        held_out_inputs=found.held_out_inputs,
        ended_early=found.ended_early,
        equivalents=find_equivalents(decision, found.table, found.context, found.base),
    )


def unusable_result(model: Model, log: CheckedRecording, fault: str) -> Reconciliation:
    """Make the result where nothing can be said."""
    return Reconciliation(
        verdict="data_unusable",
        reason=fault,
        reason_code="data_unusable",
        parts=(),
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


def _discriminating_experiments(candidates: Sequence[str]) -> str | None:
    """The measurements or manoeuvres that would separate the candidates."""
    return "; ".join(dict.fromkeys(EFFECTS[name].discriminating_experiment for name in candidates)) or None


def _final_model(found: SearchOutcome) -> EffectValues:
    lost = found.lost_fraction
    sample_loss: EffectValues = {} if lost is None else {SampleLoss.name: {"fraction": lost}}
    return {**found.model.effects, **found.decision.model.candidate.values, **sample_loss}


def _quantised(found: SearchOutcome, values: EffectValues, force_g: Array) -> Array:
    """With the steps of the readings, where the model has them."""
    if Quantization.name not in values:
        return force_g
    step_g = float(np.asarray(values[Quantization.name]["lsb_g"]))
    return quantised_mean(force_g, step_g, np.array(found.model.rig.noise_g))


def _log_curves(found: SearchOutcome) -> Curves:
    """The log at its true times, simulated by the nominal and the final model."""
    final = found.decision.model.candidate
    return _curves(found, found.recordings.log, found.nominal.fit.force_g, final.fit.force_g)


def _held_out_curves(found: SearchOutcome) -> Curves:
    """The held-out recording as stamped: which samples are lost there cannot be predicted."""
    as_stamped, validator = found.recordings.held_out_as_stamped, found.validator
    before, after = validator.evaluate(found.nominal), found.decision.model.validation
    if found.lost_fraction is not None:
        selection = selection_part(as_stamped, found.recordings.block_s)
        nominal, limits = validator.effects_of(found.nominal), validator.limits_of(found.nominal)
        before = evaluate_on_validation(found.model.rig, nominal, selection, limits=limits)
        after = evaluate_on_validation(found.model.rig, _final_model(found), selection)
    return _curves(found, as_stamped, before.fit.force_g, after.fit.force_g)


def _curves(found: SearchOutcome, observations: Observations, before_g: Array, after_g: Array) -> Curves:
    return Curves(
        observations.time_s,
        observations.force_g,
        before_g,
        _quantised(found, found.decision.model.candidate.values, after_g),
        observations.used,
        np.array(found.model.rig.noise_g),
        observations.offset_s,
    )


def _sigma(curves: Curves) -> tuple[Array, Array]:
    weight = curves.used[:, None] / curves.noise_g
    return curves.residual_before_g * weight, curves.residual_after_g * weight


def _gap(log: Curves, held_out: Curves, in_test: NDArray[np.bool_], random: np.random.Generator) -> Gap:
    """Reduced chi-square on the log, on the whole held-out recording and on its test part, before and after."""
    log_before, log_after = _reduced_chi2(log, log.used)
    held_before, held_after = _reduced_chi2(held_out, held_out.used)
    test_before, test_after = _reduced_chi2(held_out, in_test)
    before, after = (each[in_test] for each in _sigma(held_out))
    interval = block_bootstrap_gain(before, after, float(np.median(np.diff(held_out.time_s))), random)
    return Gap(log_before, held_before, test_before, log_after, held_after, test_after, interval)


def _reduced_chi2(curves: Curves, used: NDArray[np.bool_]) -> tuple[float, float]:
    before, after = (float(np.mean(each[used] ** 2)) for each in _sigma(curves))
    return before, after


def named_effect(name: str, final: RankedCandidate, found: SearchOutcome) -> NamedEffect:
    """Return an effect of a model with its parameters and their intervals."""
    effect = EFFECTS[name]
    values = final.candidate.values[name]
    simulator = found.context.setting.simulator(tuple(final.candidate.values))
    fit = final.candidate.fit
    sigma = np.zeros(len(simulator.parameters))
    sigma[fit.free] = np.sqrt(np.maximum(np.diag(coloured_covariance(fit, found.recordings.log)), 0.0))
    of = {
        p.name: [
            s
            for s, slot in zip(sigma, simulator.parameters, strict=True)
            if (slot.effect, slot.parameter) == (name, p.name)
        ]
        for p in effect.parameters
    }
    rig = found.model.rig
    parameters = {p.name: _estimate(p, values[p.name], of[p.name], rig) for p in effect.parameters}
    return NamedEffect(name, effect.explains, effect.equation, parameters, effect.interval_s(values))


def _sample_loss(found: SearchOutcome) -> NamedEffect:
    effect = EFFECTS[SampleLoss.name]
    fraction = found.lost_fraction or 0.0
    count = len(found.recordings.log.time_s)
    sigma = float(np.sqrt(fraction * (1 - fraction) / count))  # binomial
    estimate = _estimate(effect.parameters[0], fraction, [sigma], found.model.rig)
    return NamedEffect(effect.name, effect.explains, effect.equation, {"fraction": estimate}, None)


def _estimate(parameter: Parameter, value: Value, sigma: Sequence[float], rig: TwinRig) -> Estimate:
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    spread = NORMAL_975 * (np.array(sigma) if len(sigma) == len(numbers) else np.zeros(len(numbers)))
    low, high = np.maximum(numbers - spread, parameter.lower), np.minimum(numbers + spread, parameter.upper)
    doubtful = rests_at_edge(parameter, value) or bool(excess(parameter, value, rig).any())
    plausible, limit = not doubtful, limit_of(parameter, rig)
    if parameter.components:
        ci95: tuple[Value, Value] = (tuple(map(float, low)), tuple(map(float, high)))
        return Estimate(tuple(map(float, numbers)), ci95, parameter.unit, parameter.meaning, plausible, limit)
    interval = (float(low[0]), float(high[0]))
    return Estimate(float(numbers[0]), interval, parameter.unit, parameter.meaning, plausible, limit)


def _steps(found: SearchOutcome) -> tuple[Step, ...]:
    """The moves of the search, each with its gap on the selection part."""
    steps = []
    for move in found.table.moves:
        validation = found.validator.evaluate(found.table.fits[move.names])
        added, dropped, names = (tuple(sorted(each)) for each in (move.added, move.dropped, move.names))
        steps.append(Step(added, dropped, names, move.reduced_chi2, validation.reduced_chi2, move.bic))
    return tuple(steps)


def _scores(found: SearchOutcome) -> tuple[ScoreTestResult, ...]:
    inflation = found.table.noise_inflation
    excess = max(found.base.fit.chi2 - found.recordings.log.n_values, 1.0)
    signatures = found.context.signatures(found.base)
    gains = sorted(((signatures.predicted_chi2_drop(name), name) for name in signatures.of), reverse=True)
    return tuple(
        ScoreTestResult(name, min(1.0, gain / excess), gain / inflation, MIN_SCORE_STATISTIC) for gain, name in gains
    )


def _ranking(found: SearchOutcome) -> tuple[Candidate, ...]:
    validated = {each.names: each for each in found.ranked}
    least = min(each.bic for each in found.ranked)
    result = []
    for fit in found.table.ranked()[:MAX_RANKED]:
        known, bic = validated.get(fit.names), found.table.bic(fit)
        behind = max(0.0, bic - least) if known is None else known.evidence_deficit
        chi2 = None if known is None else known.validation.reduced_chi2
        rival = known is not None and 0 <= behind < MIN_EVIDENCE_MARGIN
        result.append(Candidate(tuple(sorted(fit.names)), fit.reduced_chi2, chi2, bic, behind, rival))
    return tuple(sorted(result, key=lambda candidate: candidate.behind))


def _equations(effects: Mapping[str, object]) -> tuple[str, ...]:
    return tuple(f"{name}: {effect.equation}" for name, effect in EFFECTS.items() if name in effects)
