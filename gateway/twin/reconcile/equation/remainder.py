"""The remainder of a reconciliation: where something is left that no effect explains, a law describes it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gateway.twin.effects.term_library import registered_library
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.decision.evidence import RankedCandidate
from gateway.twin.reconcile.equation.selection import FoundLaw, find_law, leaves_residual
from gateway.twin.reconcile.output.outcome import SearchOutcome
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.result_builder import build_result
from gateway.twin.reconcile.search.candidates import MOST_OF_GAP, CandidateFit
from gateway.twin.reconcile.search.validation import ValidationFit
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES


def describe_result(found: SearchOutcome, counts: Mapping[str, int], random: np.random.Generator) -> Reconciliation:
    """Return the result of a search, with the law of what is left where something is and the test part does not refute it."""
    if not found.decision.leaves_remainder or found.run.context.budget.is_over():
        return build_result(found, counts, random)
    with registered_library():
        described = _describe(found, random)
        result = build_result(described, counts, random)
        return build_result(found, counts, random) if _is_refuted(result) else result


def _is_refuted(result: Reconciliation) -> bool:
    """Return whether the law makes the prediction of the test part worse: then it describes nothing."""
    closed_percent = None if result.law is None else result.law.closed_test_percent
    return closed_percent is not None and closed_percent < 0


def _describe(found: SearchOutcome, random: np.random.Generator) -> SearchOutcome:
    """Seek a law beside what is certain, and beside the best attempt where that one does not explain everything."""
    decision, attempt = found.decision, found.decision.model
    known = decision.known
    certain = {name: each for name, each in attempt.candidate.values.items() if name in known}
    law = _law_beside(found, certain, (), random)
    if (law is None or leaves_residual(found.run.context, law, found.run.validator)) and _is_worth_extending(found):
        other = _law_beside(found, attempt.candidate.values, tuple(attempt.names - known), random)
        if other is not None and (law is None or _evidence_of(found, other) < _evidence_of(found, law)):
            law = other
    if law is None:
        return found
    if _evidence_of(found, law) > _evidence(found, attempt.candidate, attempt.validation, law.noise_inflation):
        return found
    model = RankedCandidate(law.candidate, law.after, found.run.table.bic(law.candidate), 0.0)
    return replace(found, decision=replace(decision, model=model), law=law)


def _law_beside(
    found: SearchOutcome, values: EffectValues, optional: tuple[str, ...], random: np.random.Generator
) -> FoundLaw | None:
    run = found.run
    base = run.table.get(values) or run.context.fit_apart(values)
    try:
        return None if base is None else find_law(run.context, base, run.validator, random, optional)
    except INTEGRATION_FAILURES:  # a base that diverges on the held-out recording describes nothing
        return None


def _is_worth_extending(found: SearchOutcome) -> bool:
    """Whether the best attempt has effects that are not certain and closes a good part of the gap."""
    decision, attempt = found.decision, found.decision.model
    if attempt.names <= decision.known:
        return False
    before = found.run.validator.evaluate(found.run.base).reduced_chi2
    return before - attempt.validation.reduced_chi2 > MOST_OF_GAP * (before - 1)


def _evidence_of(found: SearchOutcome, law: FoundLaw) -> float:
    return _evidence(found, law.candidate, law.after, law.noise_inflation)


def _evidence(
    found: SearchOutcome, candidate: CandidateFit, validation: ValidationFit, noise_inflation: float
) -> float:
    table = replace(found.run.table, noise_inflation=noise_inflation)
    return table.bic(candidate) + validation.fit.chi2 / noise_inflation
