"""What was considered: evidence before fitting, and rivals after it."""

import math

from gateway.twin.reconcile.result import Candidate, Reconciliation, Scored
from gateway.twin.report.markup import Html, bar, element, joined, missing, paragraph, section, table
from gateway.twin.report.words import listed, number, percent, plain

MOST = 10


def ranking_part(result: Reconciliation) -> Html:
    """Scores, then fitted candidates."""
    return section(
        "What was considered",
        element("h3", "Evidence before fitting"),
        _scores(result.scores),
        element("h3", "Candidates after fitting"),
        _candidates(result),
        name="ranking",
    )


def _scores(scores: tuple[Scored, ...]) -> Html:
    if not scores:
        return missing("No effect was tested.")
    ordered = sorted(scores, key=lambda each: -each.drop)
    rows = [
        (
            plain(each.name),
            percent(100 * each.drop),
            bar(each.drop, "strong" if each.statistic > each.threshold else "weak"),
            number(each.statistic),
            number(each.threshold),
            "yes" if each.statistic > each.threshold else "no",
        )
        for each in ordered[:MOST]
    ]
    return joined(
        [
            paragraph(
                "How much of the unexplained part each effect alone could take away at most. Several effects can claim the same "
                "part, so a high bar is a suspicion, not an answer. "
                "The threshold is what noise alone reaches once in a thousand searches."
            ),
            table(("effect", "could explain", "", "evidence", "threshold", "more than noise"), rows, numbers=(1, 3, 4)),
            _others(len(ordered) - MOST),
        ]
    )


def _candidates(result: Reconciliation) -> Html:
    if not result.ranking:
        return missing("No candidate was fitted.")
    ordered = sorted(result.ranking, key=lambda each: each.behind)
    most = max((each.behind for each in ordered[:MOST] if math.isfinite(each.behind)), default=0.0)
    rows = [
        (
            _named(each),
            number(each.chi2_log),
            "not judged" if each.chi2_held_out is None else number(each.chi2_held_out),
            _behind(each),
            bar(_length(each.behind, most), "strong" if _tied(each) else "weak"),
            _standing(each),
        )
        for each in ordered[:MOST]
    ]
    return joined(
        [
            paragraph(
                "Each set of effects was fitted with everything else that is unknown. Evidence counts how well it explains both "
                "recordings and charges for each parameter; "
                "the bar, on a logarithmic scale, is how far a set falls behind the best."
            ),
            table(
                ("effects", "gap, recording", "gap, held-out", "behind the best by", "", "standing"),
                rows,
                numbers=(1, 2, 3),
            ),
            _others(len(ordered) - MOST),
            paragraph("None of them explains the data.") if result.verdict == "unmodelled" else "",
        ]
    )


def _named(candidate: Candidate) -> str:
    return listed(candidate.names) if candidate.names else "model as believed"


def _tied(candidate: Candidate) -> bool:
    return candidate.rival or candidate.behind <= 0


def _behind(candidate: Candidate) -> str:
    return "0 (best)" if candidate.behind <= 0 else number(candidate.behind)


def _length(behind: float, most: float) -> float:
    if not math.isfinite(behind):
        return 1.0
    return math.log1p(max(behind, 0.0)) / math.log1p(most) if most > 0 else 0.0


def _standing(candidate: Candidate) -> Html:
    if candidate.behind <= 0:
        return element("span", "best", class_="tag")
    if candidate.rival:
        return element("span", "rival: fits as well", class_="tag bad")
    return element("span", "falls behind")


def _others(count: int) -> Html:
    return paragraph(f"… and {count} more, further behind.") if count > 0 else Html("")
