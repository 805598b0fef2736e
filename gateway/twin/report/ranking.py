"""The effects considered: score test before fitting, candidates after it."""

import math

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Candidate, Reconciliation


def ranked_candidates(result: Reconciliation) -> list[Candidate]:
    """Return the sets of effects that were fitted, the best one first."""
    return sorted(result.ranking, key=lambda each: (each.behind, each.chi2_held_out is None))


def is_transient(name: str) -> bool:
    """Return whether an effect acts for a time only."""
    known = EFFECTS.get(name)
    return known is not None and known.transient


def relative_deficit(candidate: Candidate, candidates: list[Candidate]) -> float:
    """Return the deficit of a candidate on a logarithmic scale, as a share of the largest."""
    if not math.isfinite(candidate.behind):
        return 1.0
    most = max(each.behind for each in candidates if math.isfinite(each.behind))
    return math.log1p(max(candidate.behind, 0.0)) / math.log1p(most) if most > 0 else 0.0


def assessment(candidate: Candidate, best: Candidate) -> str:
    """Return the class of a candidate: best, rival, trifle or worse.

    The best set with more effects may fit a little better: too little for a name, so the addition was dropped.
    """
    if candidate is best:
        return "best"
    if candidate.rival:
        return "rival"
    return "trifle" if set(candidate.names) > set(best.names) else "worse"
