"""Effects that these data cannot distinguish."""

import math

from gateway.twin.reconcile.output.result import Confusable, Reconciliation

SAME_SIGNATURE = 0.9995
"""Offset, mount, cross-axis and wind lie above it on an ordinary recording."""


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
