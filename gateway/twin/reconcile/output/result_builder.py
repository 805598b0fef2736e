"""The result in full, from a search and its decision: curves, gaps, intervals, the law of a remainder, ranking, equations."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.stats import NORMAL_975, true_runs
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Parameter, ParameterKind, Value, excess, limit_of, rests_at_edge
from gateway.twin.effects.sensor import Quantization, SampleLoss
from gateway.twin.effects.terms import TERMS
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.crane_inputs import merge_spans
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations, Recordings, part_of
from gateway.twin.reconcile.data.sensor import quantised_mean_g
from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_MARGIN, RankedCandidate
from gateway.twin.reconcile.decision.verdict import Decision
from gateway.twin.reconcile.equation import FoundLaw
from gateway.twin.reconcile.fit.intervals import intervals
from gateway.twin.reconcile.output.result import (
    Candidate,
    Comparison,
    Curves,
    DataPart,
    Equivalent,
    Estimate,
    Gap,
    Law,
    LawTerm,
    NamedEffect,
    Reconciliation,
    Resemblance,
    Step,
    Verdict,
)
from gateway.twin.reconcile.residual import analyse_residual, describe_remainder, localise_residual
from gateway.twin.reconcile.search.search import SearchRun
from gateway.twin.reconcile.search.signatures import (
    any_length_changes,
    coincident_effects,
    orthonormal,
    scorable_effects,
)
from gateway.twin.reconcile.search.validation import block_bootstrap_gain, evaluate_on_validation

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """A search, what was decided of its sets of effects, and the law of what they leave."""

    run: SearchRun
    ranked: list[RankedCandidate]
    decision: Decision
    ended_early: bool
    """The search was ended before it had tried all that it would have."""
    law: FoundLaw | None = None
    """The law of what no effect explains; part of the decision's model."""

    @property
    def rig(self) -> TwinRig:
        """The nominal rig."""
        return self.run.known.model.rig

    @property
    def model(self) -> EffectValues:
        """All effects of the final model."""
        lost = self.run.lost_fraction
        sample_loss: EffectValues = {} if lost is None else {SampleLoss.name: {"fraction": lost}}
        return {**self.run.known.model.effects, **self.decision.model.candidate.values, **sample_loss}

    def log_curves(self) -> Curves:
        """The log at its true times, simulated by the nominal and the final model."""
        final = self.decision.model.candidate
        return self._curves(self.run.recordings.log, self.run.nominal.fit.force_g, final.fit.force_g)

    def held_out_curves(self) -> Curves:
        """The held-out recording as stamped: which samples are lost there cannot be predicted."""
        run, as_stamped = self.run, self.run.recordings.held_out_as_stamped
        before, after = run.validator.evaluate(run.nominal), self.decision.model.validation
        if run.lost_fraction is not None:
            selection = part_of(as_stamped, run.recordings.block_s, is_test=False)
            nominal, limits = run.validator.effects_of(run.nominal), run.validator.limits_of(run.nominal)
            before = evaluate_on_validation(self.rig, nominal, selection, limits=limits)
            after = evaluate_on_validation(self.rig, self.model, selection)
        return self._curves(as_stamped, before.fit.force_g, after.fit.force_g)

    def _curves(self, observations: Observations, before_g: Array, after_g: Array) -> Curves:
        """Of the final model with the steps of the readings, where it has them."""
        noise_g, values = np.array(self.rig.noise_g), self.decision.model.candidate.values
        if Quantization.name in values:
            step_g = float(np.asarray(values[Quantization.name]["lsb_g"]))
            after_g = quantised_mean_g(after_g, step_g, noise_g)
        time_s, measured_g = observations.time_s, observations.force_g
        return Curves(time_s, measured_g, before_g, after_g, observations.used, noise_g, observations.offset_s)


def measure_gap(log: Curves, held_out: Curves, recordings: Recordings, random: np.random.Generator) -> Gap:
    """Return reduced chi-square on the log, on the whole held-out recording and on its test part, before and after."""
    in_test = part_of(recordings.held_out_as_stamped, recordings.block_s, is_test=True).used
    log_before, log_after = _reduced_chi2(log, log.used)
    held_before, held_after = _reduced_chi2(held_out, held_out.used)
    test_before, test_after = _reduced_chi2(held_out, in_test)
    before, after = (each[in_test] for each in held_out.residuals_sigma)
    interval = block_bootstrap_gain(before, after, float(np.median(np.diff(held_out.time_s))), random)
    return Gap(log_before, held_before, test_before, log_after, held_after, test_after, interval)


def _reduced_chi2(curves: Curves, used: NDArray[np.bool_]) -> tuple[float, float]:
    before, after = (float(np.mean(each[used] ** 2)) for each in curves.residuals_sigma)
    return before, after


def list_data_parts(recordings: Recordings) -> tuple[DataPart, ...]:
    """Return what each part of the data served; times count from the first sample of the recording as given."""
    log, held_out, block_s = recordings.log, recordings.held_out_as_stamped, recordings.block_s
    recording: Literal["log", "held_out"] = "log" if recordings.last_third else "held_out"
    selection, test = (part_of(held_out, block_s, is_test=each) for each in (False, True))
    return (
        DataPart("fit", "log", ((0.0, log.duration_s),), int(log.used.sum())),
        DataPart("selection", recording, _blocks_s(selection, block_s), int(selection.used.sum())),
        DataPart("test", recording, _blocks_s(test, block_s), int(test.used.sum())),
    )


def _blocks_s(part: Observations, block_s: float) -> tuple[tuple[float, float], ...]:
    ends_s = part.time_s + part.offset_s
    spans_s = [(float(ends_s[first]), float(ends_s[stop - 1])) for first, stop in true_runs(part.used)]
    return tuple(merge_spans(spans_s, block_s / 2))  # a spike left out does not end a block


MAX_RANKED = 12
MAX_RESEMBLANCES = 3
MIN_RESEMBLANCE = 0.5
"""Cosine below which an effect is not said to resemble a term."""
BASE_EQUATIONS = (
    "n″ = (I − n nᵀ)(g − a_p + F/m)/L − 2 (L′/L) n′ − |n′|² n",
    "f = a_p + r n″ + 2 r′ n′ + r″ n − g, in the housing's axes",
)


def build_result(found: SearchOutcome, counts: Mapping[str, int], random: np.random.Generator) -> Reconciliation:
    """Put everything into one record."""
    decision, recordings, run = found.decision, found.run.recordings, found.run
    log_curves, held_curves = found.log_curves(), found.held_out_curves()
    setting, final = run.context.setting, decision.model.candidate
    # Beside a remainder there are no companions: each of them would take a part of it.
    companions = () if decision.leaves_remainder or not decision.named else scorable_effects(setting)
    reaches = intervals(setting, final.fit, final.values, companions, run.table.noise_inflation)
    groups = (decision.candidates, *decision.also_one_of)
    splitting = dict.fromkeys(EFFECTS[name].discriminating_experiment for group in groups for name in group)
    return Reconciliation(
        verdict=decision.verdict,
        reason=decision.text,
        reason_code=decision.reason.name.lower(),
        comparison=Comparison(
            log=log_curves,
            held_out=held_curves,
            held_out_is_last_third=recordings.last_third,
            parts=list_data_parts(recordings),
            disagreement=localise_residual(log_curves.time_s, log_curves.residuals_sigma[0]),
            gap=measure_gap(log_curves, held_curves, recordings, random),
            residual=analyse_residual(log_curves, found.rig),
            remainder=describe_remainder(log_curves, found.rig),
        ),
        rig=found.rig,
        effects=tuple(
            _sample_loss(found) if name == SampleLoss.name else _named_effect(name, found, reaches)
            for name in decision.named
        ),
        candidates=decision.candidates,
        candidate_sets=decision.sets,
        also_one_of=decision.also_one_of,
        leaves_remainder=decision.leaves_remainder,
        split_by="; ".join(splitting) or None,
        law=None if found.law is None else _law(found.law, found, reaches),
        steps=_steps(run),
        ranking=_ranking(found),
        equations_before=(*BASE_EQUATIONS, *_equations(run.known.model.effects)),
        equations_after=(*BASE_EQUATIONS, *_equations(found.model)),
        refitted_on_held_out=decision.model.validation.refitted_parameters,
        counts=counts,
        model=found.model,
        inputs=run.known.inputs.found,
        held_out_inputs=() if recordings.last_third else run.known.held_out_inputs.found,
        ended_early=found.ended_early,
        equivalents=_equivalents(found),
    )


def unusable_result(model: Model, log: CheckedRecording, fault: str) -> Reconciliation:
    """Make the result where nothing can be said."""
    unusable: Verdict = "data_unusable"
    return Reconciliation(unusable, fault, unusable, model.rig, log.counts, model.effects)


Reaches = tuple[Array, Array]
"""How far the interval of each value of the final model reaches below and above it, (values,) each."""


def _named_effect(name: str, found: SearchOutcome, reaches: Reaches) -> NamedEffect:
    """Return an effect of the final model with its parameters and their intervals."""
    effect, final = EFFECTS[name], found.decision.model.candidate
    values, (below, above) = final.values[name], reaches
    simulator = found.run.context.setting.simulator(tuple(final.values))
    parameters, stated = {}, found.run.known.model.effects.get(name, {})
    for p in effect.parameters:
        own = [(spec.effect, spec.name) == (name, p.name) for spec in simulator.parameters]
        # A cutoff is fitted by its inverse.
        scale = np.square(values[p.name]) if p.kind is ParameterKind.CUTOFF else 1.0
        estimate = _estimate(p, values[p.name], scale * below[own], scale * above[own], found.rig)
        parameters[p.name] = replace(estimate, stated=stated.get(p.name))
    return NamedEffect(name, effect.explains, effect.equation, parameters, effect.interval_s(values))


def _sample_loss(found: SearchOutcome) -> NamedEffect:
    effect = EFFECTS[SampleLoss.name]
    fraction = found.run.lost_fraction or 0.0
    count = len(found.run.recordings.log.time_s)
    reach = NORMAL_975 * np.sqrt([fraction * (1 - fraction) / count])  # binomial
    estimate = _estimate(effect.parameters[0], fraction, reach, reach, found.rig)
    return NamedEffect(effect.name, effect.explains, effect.equation, {"fraction": estimate}, None)


def _estimate(parameter: Parameter, value: Value, below: Array, above: Array, rig: TwinRig) -> Estimate:
    """Return a value with its interval, which reaches from `below` to `above` it, (components,) each; empty: not fitted."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if len(below) != len(numbers):
        below = above = np.zeros(len(numbers))
    low, high = np.maximum(numbers - below, parameter.lower), np.minimum(numbers + above, parameter.upper)
    doubtful = rests_at_edge(parameter, value) or bool(excess(parameter, value, rig).any())
    plausible, limit = not doubtful, limit_of(parameter, rig)

    def as_value(each: Array) -> Value:
        return tuple(each.tolist()) if parameter.components else float(each[0])

    return Estimate(
        as_value(numbers),
        (as_value(low), as_value(high)),
        parameter.unit,
        parameter.meaning,
        plausible,
        limit,
        components=parameter.components,
        refitted=parameter.refitted,
    )


def _law(law: FoundLaw, found: SearchOutcome, reaches: Reaches) -> Law:
    """Return the law of a remainder: terms with intervals, what they close on the test part, and what they resemble."""
    test = found.run.recordings.test
    before, after = (test.reduced_chi2(each.fit.force_g) for each in (law.before, law.after))
    return Law(
        terms=tuple(_term(name, law, found, reaches) for name in law.terms),
        beside=tuple(sorted(law.candidate.names - set(law.terms))),
        closed_test_percent=Gap.closed_percent(before, after),
    )


def _term(name: str, law: FoundLaw, found: SearchOutcome, reaches: Reaches) -> LawTerm:
    term, values = TERMS[name], law.candidate.values[name]
    return LawTerm(
        name=name,
        text=f"{term.quantity} = {term.law(values)}",
        meaning=term.in_words(values),
        parameters=_named_effect(name, found, reaches).parameters,
        alternatives=law.alternatives[name],
        closest_effects=_closest_effects(law.signatures[name], found.run.context.signatures(law.base).of),
    )


def _closest_effects(signature: Array, of: Mapping[str, Array]) -> tuple[Resemblance, ...]:
    size = float(np.linalg.norm(signature))
    found = []
    for name, columns in of.items():
        basis = orthonormal(columns)
        cosine = float(np.linalg.norm(basis.T @ signature)) / size if basis.shape[1] else 0.0
        if cosine > MIN_RESEMBLANCE:
            # An effect of one parameter that has a sign may need the other one.
            one_sided = [p.lower == 0 and p.size == 1 for p in EFFECTS[name].parameters] == [True]
            is_reversed = one_sided and float(columns[:, 0] @ signature) < 0
            found.append(Resemblance(name, min(cosine, 1.0), is_reversed))
    return tuple(sorted(found, key=lambda each: -each.cosine)[:MAX_RESEMBLANCES])


def _equivalents(found: SearchOutcome) -> tuple[Equivalent, ...]:
    """Return what coincides with named effects or candidates; nothing where a length changes: there they were rivals."""
    decision, setting, fitted = found.decision, found.run.context.setting, found.decision.model.candidate.values
    if any_length_changes((*fitted, *setting.model_effects)):
        return ()
    answer = {name: fitted[name] for name in (*decision.named, *decision.candidates) if name in fitted}
    for name in set(decision.candidates) - fitted.keys():
        alone = found.run.table.get({*found.run.base.names, name})
        answer |= {} if alone is None else {name: alone.values[name]}
    return tuple(
        Equivalent(name, of, values, EFFECTS[name].discriminating_experiment)
        for name, of, values in coincident_effects(answer, setting.rig.length_m)
        if name not in setting.model_effects
    )


def _steps(run: SearchRun) -> tuple[Step, ...]:
    """The moves of the search, each with its gap on the selection part."""
    steps = []
    for move in run.table.moves:
        validation = run.validator.evaluate(run.table.fits[move.names])
        added, dropped, names = (tuple(sorted(each)) for each in (move.added, move.dropped, move.names))
        steps.append(Step(added, dropped, names, move.reduced_chi2, validation.reduced_chi2, move.bic))
    return tuple(steps)


def _ranking(found: SearchOutcome) -> tuple[Candidate, ...]:
    validated = {each.names: each for each in found.ranked}
    least = min(each.bic for each in found.ranked)
    result = []
    for fit in found.run.table.ranked()[:MAX_RANKED]:
        known, bic = validated.get(fit.names), found.run.table.bic(fit)
        behind = max(0.0, bic - least) if known is None else known.evidence_deficit
        chi2 = None if known is None else known.validation.reduced_chi2
        rival = known is not None and 0 <= behind < MIN_EVIDENCE_MARGIN
        result.append(Candidate(tuple(sorted(fit.names)), fit.reduced_chi2, chi2, bic, behind, rival))
    return tuple(sorted(result, key=lambda candidate: candidate.behind))


def _equations(effects: Mapping[str, object]) -> tuple[str, ...]:
    return tuple(f"{name}: {effect.equation}" for name, effect in EFFECTS.items() if name in effects)
