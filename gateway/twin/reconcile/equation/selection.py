"""Selection of terms: forward by evidence on the log and the selection part, then backward; never by the test part.

Each round screens the library by linearisations, fits the best few terms beside what the law has already, and keeps the one
with the most evidence if it is significant on the log, in coloured noise too, and lowers the residual of the selection part.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.term_library import TERMS
from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_MARGIN, VALIDATED_MARGIN
from gateway.twin.reconcile.equation.screening import ScreenedTerm, screen_terms
from gateway.twin.reconcile.residual import noise_inflation_factor, warrants_another_effect
from gateway.twin.reconcile.search.budget import FitRequest
from gateway.twin.reconcile.search.candidates import (
    LITTLE_OF_GAP,
    MAX_EFFECTS,
    MOST_OF_GAP,
    CandidateFit,
    CandidateTable,
)
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.persistent import MAX_SCORED
from gateway.twin.reconcile.search.validation import ValidationFit, Validator

MAX_WORK = 2.5e7
"""Derivatives of states and readings in fits after which nothing further is fitted, some 3 s on one core of a desk."""
MIN_GAIN_SHARE = 0.3
"""Gain of a term by linearisation over the largest of the round, below which it is not fitted."""
COLLINEAR_COSINE = 0.999
"""Cosine of two terms' signatures from which one may stand for the other."""


@dataclass(frozen=True, slots=True)
class FoundLaw:
    """A law beside the effects of a model, with what came near it."""

    base: CandidateFit
    """The model that the law is added to."""
    candidate: CandidateFit
    before: ValidationFit
    """Of the base on the selection part; it predicts the test part."""
    after: ValidationFit
    terms: tuple[str, ...]
    """In the order in which they were chosen."""
    alternatives: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """For each term others that describe the data nearly as well, the closest first."""
    signatures: dict[str, np.ndarray] = field(default_factory=dict)
    """What each term changes in the log, in sigma, the initial motion and the base projected out, shape (3 n,)."""
    noise_inflation: float = 1.0


def find_law(
    context: SearchContext, base: CandidateFit, validator: Validator, random: np.random.Generator
) -> FoundLaw | None:
    """Return the law of what a model leaves; None where no term describes it. The library must be registered."""
    before = validator.evaluate(base)
    law = FoundLaw(base, base, before, before, ())
    work = context.budget.work + MAX_WORK
    while len(law.terms) < MAX_EFFECTS and context.budget.work < work:
        table = CandidateTable(context.setting.log).with_fit(law.candidate)
        longer = _with_one_more(context, table, law, validator, random, work)
        if longer is None:
            break
        law = longer
        if not leaves_residual(context, law, validator):
            break
    if not law.terms or min(_share_closed(base, law.candidate), _share_closed(before, law.after)) < MOST_OF_GAP:
        return None
    return _without_idle_terms(context, law, validator, work)


def leaves_residual(context: SearchContext, law: FoundLaw, validator: Validator) -> bool:
    """Return whether a law leaves more than noise."""
    on_log = warrants_another_effect(context.setting.log, law.candidate.fit)
    return on_log or warrants_another_effect(validator.selection, law.after.fit)


def _with_one_more(
    context: SearchContext,
    table: CandidateTable,
    law: FoundLaw,
    validator: Validator,
    random: np.random.Generator,
    max_work: float,
) -> FoundLaw | None:
    """Return the law with the term of most evidence beside the base; None where none is significant.

    Fits end at `max_work`.
    """
    screened = sorted(screen_terms(context.setting, law.candidate), key=lambda each: -_score(each, context, law))
    largest = max((each.gain for each in screened), default=0.0)
    chosen = [each for each in screened if each.gain > MIN_GAIN_SHARE * largest][:MAX_SCORED]
    starts, give_up_above = context.segment_starts(law.candidate), 2 * law.candidate.fit.chi2
    requests = [
        FitRequest({**law.candidate.values, each.name: each.values}, starts, give_up_above=give_up_above)
        for each in chosen
    ]
    table = context.fit_in_turn(table, requests, lambda _table, _request: context.budget.work <= max_work).start_round()
    limit = table.bic(table.best) + VALIDATED_MARGIN
    fitted = [(each, table.get({*law.candidate.values, each.name})) for each in chosen]
    near_best = [
        (each, fit)
        for each, fit in fitted
        if fit is not None and table.bic(fit) < limit and table.is_significant(law.candidate, fit)
        if not pairs_loss_with_gain(fit, each.name) and not replaces_loss(fit, law.base)
    ]
    validator.evaluate_ahead(fit for _, fit in near_best)
    validated = ((each, fit, validator.evaluate(fit)) for each, fit in near_best)
    rivals = [_Rival(each, fit, found, table.evidence(fit, found.fit.chi2)) for each, fit, found in validated]
    rivals.sort(key=lambda each: each.evidence)
    if not rivals or not _holds(law, rivals[0], validator, random):
        return None
    best, limit = rivals[0], rivals[0].evidence + MIN_EVIDENCE_MARGIN
    near = [each.screened for each in rivals if each.evidence < limit]
    near += [each for each in screened if _cosine(each, best.screened) > COLLINEAR_COSINE]
    name = best.screened.name
    return replace(
        law,
        candidate=best.fit,
        after=best.validation,
        terms=(*law.terms, name),
        alternatives={**law.alternatives, name: tuple(dict.fromkeys(each.name for each in near if each.name != name))},
        signatures={**law.signatures, name: best.screened.signature},
        noise_inflation=table.noise_inflation,
    )


def replaces_loss(fit: CandidateFit, base: CandidateFit) -> bool:
    """Return whether a law takes the place of a loss of its base: it describes what that leaves, or contradicts its name."""
    losses = [name for name in base.names if EFFECTS[name].dissipative]
    left, before = (np.array([_amplitude(each, name) for name in losses]) for each in (fit, base))
    return bool((left < LITTLE_OF_GAP * before).any())


def _amplitude(fit: CandidateFit, name: str) -> float:
    """Return the largest deviation of the parameters that say how strong an effect is."""
    amplitudes = [each for each in EFFECTS[name].parameters if each.is_amplitude]
    return max(
        (float(np.max(np.abs(np.subtract(fit.values[name][p.name], p.neutral)))) for p in amplitudes), default=0.0
    )


def pairs_loss_with_gain(fit: CandidateFit, term: str) -> bool:
    """Return whether a term feeds in what a loss beside it takes out: as one loss of another shape, each has a false size."""
    return TERMS[term].feeds_energy(fit.values[term]) and any(EFFECTS[name].dissipative for name in fit.names)


@dataclass(frozen=True, slots=True)
class _Rival:
    """A term that was fitted in a round."""

    screened: ScreenedTerm
    fit: CandidateFit
    validation: ValidationFit
    evidence: float


def _score(screened: ScreenedTerm, context: SearchContext, law: FoundLaw) -> float:
    """Gain of a linearisation over the noise inflation, less the penalty of its parameters."""
    log = context.setting.log
    residual = log.residual_sigma(law.candidate.fit.force_g)
    inflation = noise_inflation_factor(log.time_s, residual - screened.signature.reshape(residual.shape))
    return screened.gain / inflation - screened.n_parameters * math.log(log.n_values)


def _holds(law: FoundLaw, rival: _Rival, validator: Validator, random: np.random.Generator) -> bool:
    """Whether a term describes the selection part, too."""
    before, after = law.after, rival.validation
    return _share_closed(before, after) > LITTLE_OF_GAP and validator.is_improved(before, after, random)


def _share_closed(before: CandidateFit | ValidationFit, after: CandidateFit | ValidationFit) -> float:
    return (before.reduced_chi2 - after.reduced_chi2) / max(before.reduced_chi2 - 1, 1e-9)


def _cosine(first: ScreenedTerm, second: ScreenedTerm) -> float:
    norms = np.linalg.norm(first.signature) * np.linalg.norm(second.signature)
    return 0.0 if norms == 0 else float(abs(first.signature @ second.signature) / norms)


def _without_idle_terms(context: SearchContext, law: FoundLaw, validator: Validator, max_work: float) -> FoundLaw:
    """Remove terms whose absence costs no evidence: a later term may have replaced them."""
    table = CandidateTable(context.setting.log).with_fit(law.candidate)
    table = replace(table, noise_inflation=law.noise_inflation)
    for name in law.terms[:-1]:
        if context.budget.work > max_work:
            break
        values = law.candidate.without(name)
        table = context.fit(table, values)
        shorter = table.get(values)
        if shorter is None:
            continue
        after = validator.evaluate(shorter)
        limit = table.evidence(law.candidate, law.after.fit.chi2) + MIN_EVIDENCE_MARGIN
        if table.evidence(shorter, after.fit.chi2) < limit:
            law = replace(law, candidate=shorter, after=after, terms=tuple(t for t in law.terms if t != name))
    return law
