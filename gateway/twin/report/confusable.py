"""Effects that these data cannot distinguish, and how to separate them."""

import math
from dataclasses import dataclass

from gateway.documents.text import as_sentence, human_name, join_names
from gateway.twin.reconcile.output.result import Confusable, Reconciliation

SAME_SIGNATURE = 0.9995
"""Offset, mount, cross-axis and wind lie above it on an ordinary recording."""
MOST = 12


@dataclass(frozen=True, slots=True)
class PairRow:
    """Two effects with similar signatures."""

    first: str
    second: str
    cosine: str
    angle: str
    is_same: bool


@dataclass(frozen=True, slots=True)
class ConfusableView:
    """The section as it is printed."""

    is_group: bool
    """The answer is one of a group."""
    group: str
    """Names of the group; empty where they were not recorded."""
    experiment: str
    """What would separate the group; empty where nothing was found."""
    has_named: bool
    twins: tuple[tuple[str, str], ...]
    """Named effects, each with one of the same signature."""
    was_compared: bool
    pairs: tuple[PairRow, ...]
    more_pairs: int


def confusable_view(result: Reconciliation) -> ConfusableView:
    """Return the group that is the answer, then all pairs that look alike in these data."""
    named = {effect.name for effect in result.effects}
    answer = named | set(result.candidates)
    ordered = sorted(result.confusable, key=lambda each: (not {each.first, each.second} & answer, -each.cosine))
    return ConfusableView(
        is_group=result.verdict == "one_of",
        group=join_names(result.candidates) if result.candidates else "",
        experiment=as_sentence(result.split_by or ""),
        has_named=bool(named),
        twins=_twins(result.confusable, named),
        was_compared=bool(result.confusable or result.scores),
        pairs=tuple(_row(each) for each in ordered[:MOST]),
        more_pairs=max(0, len(ordered) - MOST),
    )


def _twins(confusable: tuple[Confusable, ...], named: set[str]) -> tuple[tuple[str, str], ...]:
    """Return named effects whose small signature equals that of another: only the fits separate them."""
    twins = [p for p in confusable if p.cosine >= SAME_SIGNATURE and len({p.first, p.second} & named) == 1]
    pairs = [(p.first, p.second) if p.first in named else (p.second, p.first) for p in twins]
    return tuple((human_name(name), human_name(other)) for name, other in pairs)


def _row(pair: Confusable) -> PairRow:
    angle_deg = math.degrees(math.acos(min(1.0, max(-1.0, pair.cosine))))
    return PairRow(
        human_name(pair.first),
        human_name(pair.second),
        f"{pair.cosine:.4f}",
        f"{angle_deg:.1f}°",
        pair.cosine >= SAME_SIGNATURE,
    )
