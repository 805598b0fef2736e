"""The effects considered, in the order of the evidence, and pairs of them that these data cannot distinguish."""

import math

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Candidate, Confusable, Reconciliation

SAME_SIGNATURE = 0.9995
"""Offset, mount, cross-axis and wind lie above it on an ordinary recording."""


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


def pairs_by_interest(result: Reconciliation) -> list[Confusable]:
    """Return all pairs that look alike in these data, those with an effect of the answer first."""
    answer = {effect.name for effect in result.effects} | set(result.candidates)
    return sorted(result.confusable, key=lambda each: (not {each.first, each.second} & answer, -each.cosine))


def has_same_signature(pair: Confusable) -> bool:
    """Return whether two effects are practically the same here."""
    return pair.cosine >= SAME_SIGNATURE


def twins_of_named(result: Reconciliation) -> list[tuple[str, str]]:
    """Return named effects whose small signature equals that of another: only the fits separate them."""
    named = {effect.name for effect in result.effects}
    twins = [p for p in result.confusable if has_same_signature(p) and len({p.first, p.second} & named) == 1]
    return [(p.first, p.second) if p.first in named else (p.second, p.first) for p in twins]


def angle_deg(pair: Confusable) -> float:
    """Return the angle between two signatures."""
    return math.degrees(math.acos(min(1.0, max(-1.0, pair.cosine))))
