"""Candidate fits ranked by all evidence: BIC on the log, chi-square on the selection part."""

from collections.abc import Collection
from dataclasses import dataclass, replace

from gateway.twin.reconcile.fit.validation import ValidationFit
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.validation_cache import Validator

MAX_VALIDATED = 4
"""Sets of effects that are evaluated on the selection part."""
MIN_EVIDENCE_MARGIN = 12.0
"""Chi-square over the noise inflation below which one set is no better than another: odds of 400 to 1."""
MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE = 20.0
"""The same for two effects with the same signature: a wrong one of them has been ahead by 6."""
VALIDATED_MARGIN = 60.0
"""BIC behind the best set on the log up to which a set is evaluated on the selection part."""

Pairs = Collection[frozenset[str]]


@dataclass(frozen=True, slots=True)
class RankedCandidate:
    """A set of effects with all its evidence."""

    candidate: CandidateFit
    validation: ValidationFit
    bic: float
    evidence_deficit: float
    """By how much its evidence is behind that of the best one; 0 for the best."""

    @property
    def names(self) -> frozenset[str]:
        """The set of effects."""
        return self.candidate.names


def rank_candidates(
    table: CandidateTable,
    best: CandidateFit,
    baseline: frozenset[str],
    validator: Validator,
    indistinguishable: Pairs,
) -> tuple[list[RankedCandidate], RankedCandidate]:
    """Evaluate the sets near the best on the selection part; return them best first, and the baseline."""
    limit = table.bic(best) + VALIDATED_MARGIN
    near = [
        fit
        for fit in table.ranked()
        if baseline <= fit.names and table.bic(fit) < limit and not contains(fit.names, best.names, indistinguishable)
    ]

    def ranked(fit: CandidateFit) -> RankedCandidate:
        return RankedCandidate(fit, validator.evaluate(fit), table.bic(fit), 0.0)

    chosen = [best, *near[: MAX_VALIDATED - 1]]
    validator.evaluate_ahead([*chosen, table.fits[baseline]])
    found = [ranked(fit) for fit in chosen]
    evidence = {each.names: each.bic + each.validation.fit.chi2 / table.noise_inflation for each in found}
    least = min(evidence.values())
    found = [replace(each, evidence_deficit=evidence[each.names] - least) for each in found]
    return sorted(found, key=lambda each: each.evidence_deficit), ranked(table.fits[baseline])


def contains(names: frozenset[str], best: frozenset[str], indistinguishable: Pairs) -> bool:
    """Whether a set has all effects of the best, or their indistinguishable partners and more: it cannot compete."""
    missing, extra = best - names, names - best
    if not missing:
        return True
    matched = all(any(frozenset((name, other)) in indistinguishable for other in extra) for name in missing)
    return matched and len(extra) > len(missing)


def rivals_of(ranked: list[RankedCandidate], indistinguishable: Pairs) -> list[RankedCandidate]:
    """The best set and all sets whose evidence is too close to its to decide between them."""
    best = ranked[0]
    return [
        each
        for each in ranked
        if each.evidence_deficit
        < (
            MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE
            if each.names ^ best.names in indistinguishable
            else MIN_EVIDENCE_MARGIN
        )
    ]
