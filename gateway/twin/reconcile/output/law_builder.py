"""The law of a remainder as the result states it: terms with intervals, what they close, and what they resemble."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.term_library import TERMS
from gateway.twin.reconcile.equation.selection import FoundLaw
from gateway.twin.reconcile.output.estimates import Law, LawTerm, Resemblance
from gateway.twin.reconcile.output.result import Gap, Reconciliation
from gateway.twin.reconcile.output.result_builder import SearchOutcome, named_effect
from gateway.twin.reconcile.residual.isolability import orthonormal

Array = NDArray[np.float64]
MAX_RESEMBLANCES = 3
MIN_RESEMBLANCE = 0.5
"""Cosine below which an effect is not said to resemble a term."""


def add_law(result: Reconciliation, found: SearchOutcome) -> Reconciliation:
    """Return the result with the law of the outcome, if it has one."""
    return result if found.law is None else replace(result, law=_law(found.law, found))


def _law(law: FoundLaw, found: SearchOutcome) -> Law:
    test = found.recordings.test
    before, after = (test.reduced_chi2(each.fit.force_g) for each in (law.before, law.after))
    return Law(
        terms=tuple(_term(name, law, found) for name in law.terms),
        beside=tuple(sorted(law.candidate.names - set(law.terms))),
        closed_test_percent=Gap.closed_percent(before, after),
    )


def _term(name: str, law: FoundLaw, found: SearchOutcome) -> LawTerm:
    term, values = TERMS[name], law.candidate.values[name]
    return LawTerm(
        name=name,
        text=f"{term.quantity} = {term.law(values)}",
        meaning=term.in_words(values),
        parameters=named_effect(name, found.decision.model, found).parameters,
        alternatives=law.alternatives[name],
        closest_effects=_closest_effects(law.signatures[name], found.context.signatures(law.base).of),
    )


def _closest_effects(signature: Array, of: Mapping[str, Array]) -> tuple[Resemblance, ...]:
    size = float(np.linalg.norm(signature))
    found = []
    for name, columns in of.items():
        basis = orthonormal(columns)
        cosine = float(np.linalg.norm(basis.T @ signature)) / size if basis.shape[1] else 0.0
        if cosine > MIN_RESEMBLANCE:
            found.append(Resemblance(name, min(cosine, 1.0), _is_reversed(name, columns, signature)))
    return tuple(sorted(found, key=lambda each: -each.cosine)[:MAX_RESEMBLANCES])


def _is_reversed(name: str, columns: Array, signature: Array) -> bool:
    """Whether an effect of one parameter that has a sign would need the other one."""
    one_sided = [p.lower == 0 and p.size == 1 for p in EFFECTS[name].parameters] == [True]
    return one_sided and float(columns[:, 0] @ signature) < 0
