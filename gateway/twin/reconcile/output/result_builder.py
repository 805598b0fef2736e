"""The answer in full: curves, gap, intervals, ranking, equations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Parameter, Value
from gateway.twin.model import Model
from gateway.twin.reconcile.data.artefact_detectors import mean_of_steps
from gateway.twin.reconcile.data.observations import Recordings
from gateway.twin.reconcile.decision.ambiguity_groups import split_by
from gateway.twin.reconcile.decision.verdict import RIVAL, Answer, Contender
from gateway.twin.reconcile.fit.validation import Judged, judge, taken_off
from gateway.twin.reconcile.output.result import (
    Candidate,
    Curves,
    Estimate,
    Gap,
    NamedEffect,
    Reconciliation,
    Scored,
    Step,
)
from gateway.twin.reconcile.residual.isolability import confusable
from gateway.twin.reconcile.residual.localisation import locate
from gateway.twin.reconcile.residual.whiteness import residual_of
from gateway.twin.reconcile.search.candidate_fits import LEAST_STATISTIC, Attempt
from gateway.twin.reconcile.search.search import Search

Array = NDArray[np.float64]
RANKED = 12
STEP_ROUNDS = 6
BASE_EQUATIONS = (
    "n″ = (I − n nᵀ)(g − a_p + F/m)/L − 2 (L′/L) n′ − |n′|² n",
    "f = a_p + r n″ + 2 r′ n′ + r″ n − g, in the housing's axes",
)
CI95 = 1.96


@dataclass(frozen=True, slots=True)
class Findings:
    """All that the answer is made from."""

    model: Model
    recordings: Recordings
    search: Search
    believed: Attempt
    """The model as believed, only the nuisances fitted."""
    believed_held_out: Judged
    contenders: list[Contender]
    answer: Answer
    lost: float | None
    """Part of the samples that is missing without a trace."""


def reconciliation(found: Findings, counts: Mapping[str, int], rng: np.random.Generator) -> Reconciliation:
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
            _sample_loss(found) if name == "sample_loss" else _named(name, final, found) for name in answer.named
        ),
        candidates=answer.candidates,
        split_by=split_by(frozenset(answer.candidates)) if answer.candidates else None,
        disagreement=locate(found.recordings.log.time_s, sigma[0]),
        gap=_gap(log_curves, held_curves, rng),
        residual=residual_of(found.recordings.log.time_s, *sigma, log_curves.noise_g),
        steps=_steps(found),
        scores=_scores(found),
        ranking=_ranking(found),
        confusable=() if found.search.signatures is None else confusable(found.search.signatures.of),
        equations_before=(*BASE_EQUATIONS, *_equations(found.model.effects)),
        equations_after=(*BASE_EQUATIONS, *_equations(_final(found))),
        log=log_curves,
        held_out=held_curves,
        held_out_is_last_third=found.recordings.last_third,
        refitted_on_held_out=final.judged.refitted,
        counts=counts,
        model=_final(found),
    )


def _final(found: Findings) -> Mapping[str, Mapping[str, Value]]:
    lost: dict[str, Mapping[str, Value]] = {} if found.lost is None else {"sample_loss": {"fraction": found.lost}}
    return {**found.model.effects, **found.answer.model.attempt.values, **lost}


def _handed_on(found: Findings, values: Mapping[str, Mapping[str, Value]], force_g: Array) -> Array:
    """With the steps of the readings, where the model has them."""
    if "quantization" not in values:
        return force_g
    step_g = float(np.asarray(values["quantization"]["lsb_g"]))
    return mean_of_steps(force_g, step_g, np.array(found.model.rig.noise_g))


def _curves(found: Findings, *, held_out: bool) -> Curves:
    """On the log at its true times; on held-out data as stamped, since which samples are lost there cannot be foretold."""
    observations = found.recordings.held_out_as_stamped if held_out else found.recordings.log
    final = found.answer.model
    after = final.judged.fit.force_g if held_out else final.attempt.fit.force_g
    if held_out and found.lost is not None:
        values = {**found.model.effects, **final.attempt.values, "sample_loss": {"fraction": found.lost}}
        after = judge(found.model.rig, values, observations).fit.force_g
    before = found.believed_held_out.fit.force_g if held_out else found.believed.fit.force_g
    return Curves(
        observations.time_s,
        observations.force_g,
        before,
        _handed_on(found, final.attempt.values, after),
        observations.used,
        np.array(found.model.rig.noise_g),
    )


def _sigma(curves: Curves) -> tuple[Array, Array]:
    weight = curves.used[:, None] / curves.noise_g
    return curves.residual_before_g * weight, curves.residual_after_g * weight


def _gap(log: Curves, held_out: Curves, rng: np.random.Generator) -> Gap:
    def reduced(curves: Curves) -> tuple[float, float]:
        before, after = _sigma(curves)
        count = 3 * int(curves.used.sum())
        return float((before**2).sum() / count), float((after**2).sum() / count)

    interval = taken_off(*_sigma(held_out), held_out.time_s, rng)
    (before_log, after_log), (before_held, after_held) = reduced(log), reduced(held_out)
    return Gap(before_log, before_held, after_log, after_held, interval)


def _named(name: str, final: Contender, found: Findings) -> NamedEffect:
    effect = EFFECTS[name]
    values = final.attempt.values[name]
    simulator = found.search.setting.simulator(tuple(final.attempt.values))
    fit = final.attempt.fit
    sigma = np.zeros(len(simulator.parameters))
    sigma[fit.free] = np.sqrt(np.maximum(np.diag(fit.covariance()), 0.0) * found.search.unit())
    of = {
        p.name: [
            s
            for s, slot in zip(sigma, simulator.parameters, strict=True)
            if (slot.effect, slot.parameter) == (name, p.name)
        ]
        for p in effect.parameters
    }
    when = None
    if effect.transient:
        start = float(np.asarray(values["start_s"]))
        length = float(np.asarray(values.get("duration_s", 0.0)))
        when = (start, start + (2 * length + float(np.asarray(values["coast_s"])) if "coast_s" in values else length))
    parameters = {p.name: _estimate(p, values[p.name], of[p.name]) for p in effect.parameters}
    return NamedEffect(name, effect.explains, effect.equation, parameters, when)


def _sample_loss(found: Findings) -> NamedEffect:
    effect = EFFECTS["sample_loss"]
    fraction = found.lost or 0.0
    count = len(found.recordings.log.time_s)
    sigma = float(np.sqrt(fraction * (1 - fraction) / count))  # binomial
    estimate = _estimate(effect.parameters[0], fraction, [sigma])
    return NamedEffect(effect.name, effect.explains, effect.equation, {"fraction": estimate}, None)


def _estimate(parameter: Parameter, value: Value, sigma: Sequence[float]) -> Estimate:
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    spread = CI95 * (np.array(sigma) if len(sigma) == len(numbers) else np.zeros(len(numbers)))
    low, high = np.maximum(numbers - spread, parameter.lower), np.minimum(numbers + spread, parameter.upper)
    resting = bool(((numbers <= parameter.lower) | (numbers >= parameter.upper)).any())
    if parameter.components:
        ci95: tuple[Value, Value] = (tuple(map(float, low)), tuple(map(float, high)))
        return Estimate(tuple(map(float, numbers)), ci95, parameter.unit, parameter.meaning, not resting)
    return Estimate(float(numbers[0]), (float(low[0]), float(high[0])), parameter.unit, parameter.meaning, not resting)


def _steps(found: Findings) -> tuple[Step, ...]:
    """Each with its gap on held-out data; sets that were judged for the verdict are not judged again."""
    known = {c.names: c.judged.reduced for c in found.contenders}
    steps = []
    for s in found.search.history:
        if s.names not in known:
            values = {**found.model.effects, **found.search.attempts[s.names].values}
            known[s.names] = judge(found.model.rig, values, found.recordings.held_out, STEP_ROUNDS).reduced
        added, dropped, names = (tuple(sorted(each)) for each in (s.added, s.dropped, s.names))
        steps.append(Step(added, dropped, names, s.reduced, known[s.names], s.bic))
    return tuple(steps)


def _scores(found: Findings) -> tuple[Scored, ...]:
    unit, excess = found.search.unit(), max(found.believed.fit.chi2 - found.recordings.log.count, 1.0)
    drops = sorted(found.search.scores.items(), key=lambda each: -each[1])
    return tuple(Scored(name, min(1.0, drop / excess), drop / unit, LEAST_STATISTIC) for name, drop in drops)


def _ranking(found: Findings) -> tuple[Candidate, ...]:
    search, unit = found.search, found.search.unit()
    judged = {c.names: c for c in found.contenders}
    best = min(c.bic for c in found.contenders)
    ranked = sorted(search.attempts.values(), key=lambda a: search.bic(a, unit))[:RANKED]
    result = []
    for attempt in ranked:
        contender = judged.get(attempt.names)
        bic = search.bic(attempt, unit)
        behind = max(0.0, bic - best) if contender is None else contender.behind
        held = None if contender is None else contender.judged.reduced
        rival = contender is not None and 0 <= behind < RIVAL
        result.append(Candidate(tuple(sorted(attempt.names)), attempt.reduced, held, bic, behind, rival))
    return tuple(sorted(result, key=lambda c: c.behind))


def _equations(effects: Mapping[str, object]) -> tuple[str, ...]:
    return tuple(f"{name}: {effect.equation}" for name, effect in EFFECTS.items() if name in effects)
