"""The remainder of a reconciliation: where something is left that no effect explains, a law describes it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gateway.twin.effects.term_library import registered_library
from gateway.twin.reconcile.decision.evidence import RankedCandidate
from gateway.twin.reconcile.equation.selection import find_law
from gateway.twin.reconcile.output.outcome import SearchOutcome
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.result_builder import build_result
from gateway.twin.reconcile.search.candidates import CandidateFit
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
    by_law = _evidence(found, law.candidate, law.after, law.noise_inflation)
    if by_law > _evidence(found, attempt.candidate, attempt.validation, law.noise_inflation):
        return found
    model = RankedCandidate(law.candidate, law.after, run.table.bic(law.candidate), 0.0)
    return replace(found, decision=replace(decision, model=model), law=law)


def _evidence(
    found: SearchOutcome, candidate: CandidateFit, validation: ValidationFit, noise_inflation: float
) -> float:
    table = replace(found.run.table, noise_inflation=noise_inflation)
    return table.bic(candidate) + validation.fit.chi2 / noise_inflation
