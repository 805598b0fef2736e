"""What these data cannot tell apart, and how to split it."""

import math

from gateway.twin.reconcile.output.result import Confusable, Reconciliation
from gateway.twin.report.markup import Html, element, items, joined, missing, paragraph, section, table
from gateway.twin.report.words import listed, plain, sentence

SAME_TRACE = 0.9995
"""Offset, mount, cross-axis and wind lie above it on an ordinary recording."""
MOST = 12


def confusable_part(result: Reconciliation) -> Html:
    """The group that is the answer, then all pairs that look alike in these data."""
    return section("What cannot be told apart", _group(result), _pairs(result), name="confusable")


def _group(result: Reconciliation) -> Html:
    if result.verdict != "one_of":
        return _twins(result)
    split = (
        paragraph(element("strong", "How to split the group: "), sentence(result.split_by))
        if result.split_by
        else missing("No manoeuvre or measurement that would split the group was found.")
    )
    if not result.candidates:
        return joined([missing("The group’s names were not recorded."), split])
    names = element("strong", listed(result.candidates))
    return joined([paragraph("Each of ", names, " explains these data equally well, so none of them is named."), split])


def _twins(result: Reconciliation) -> Html:
    """A named effect that small traces cannot tell from another stands on the fits alone: that must be said."""
    names = {effect.name for effect in result.effects}
    twins = [p for p in result.confusable if p.cosine >= SAME_TRACE and len({p.first, p.second} & names) == 1]
    if not twins:
        return paragraph("No named effect has a double in these data.") if names else Html("")
    pairs = [(p.first, p.second) if p.first in names else (p.second, p.first) for p in twins]
    return items(
        joined(
            [
                element("strong", plain(name)),
                f" leaves practically the same trace here as {plain(other)}: that it was named and not {plain(other)} "
                "rests on the fits above alone.",
            ]
        )
        for name, other in pairs
    )


def _pairs(result: Reconciliation) -> Html:
    if not result.confusable and not result.scores:
        return missing("Effects were not compared with each other.")
    if not result.confusable:
        return paragraph("No two of the effects considered look alike in these data.")
    answer = {*(effect.name for effect in result.effects), *result.candidates}
    ordered = sorted(result.confusable, key=lambda each: (not {each.first, each.second} & answer, -each.cosine))
    rows = [
        (plain(p.first), plain(p.second), f"{p.cosine:.4f}", f"{_angle_deg(p):.1f}°", _alike(p)) for p in ordered[:MOST]
    ]
    return joined(
        [
            paragraph(
                "Pairs of effects whose small traces in this recording look alike, whatever the initial motion: 0° is the same "
                "trace, 90° nothing in common; pairs with an effect of the answer come first. A strong trace can be told from "
                "one that is much alike: whether it was, the candidates’ evidence above says."
            ),
            table(("effect", "and", "cosine", "angle", "in these data"), rows, numbers=(2, 3)),
            paragraph(f"… and {len(ordered) - MOST} more.") if len(ordered) > MOST else "",
        ]
    )


def _angle_deg(pair: Confusable) -> float:
    return math.degrees(math.acos(min(1.0, max(-1.0, pair.cosine))))


def _alike(pair: Confusable) -> str:
    return "practically the same trace" if pair.cosine >= SAME_TRACE else "much alike"
