"""What was considered: evidence before fitting, and rivals after it."""

import math

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Candidate, Reconciliation, ScoreTestResult
from gateway.twin.report.markup import Html, bar, element, joined, missing, paragraph, section, table
from gateway.twin.report.words import listed, number, percent, plain

MOST = 10
EVENTS = (
    "Effects that act for a while only are not in this list: when they acted must be found first. "
    "They are among the candidates after fitting."
)


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


def _scores(scores: tuple[ScoreTestResult, ...]) -> Html:
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
                "How much of the unexplained part each effect alone promises to take away, judged by the trace that a little of "
                "it leaves; fitted, a strong effect may take away more. Several effects can claim the same part, so a high bar "
                "is a suspicion, not an answer. "
                "The threshold is what noise alone reaches once in a thousand searches. ",
                "" if any(_passes(each) for each in scores) else EVENTS,
            ),
            table(("effect", "promises", "", "evidence", "threshold", "more than noise"), rows, numbers=(1, 3, 4)),
            _others(len(ordered) - MOST),
        ]
    )


def _passes(scored: ScoreTestResult) -> bool:
    known = EFFECTS.get(scored.name)
    return known is not None and known.transient


def _candidates(result: Reconciliation) -> Html:
    if not result.ranking:
        return missing("No candidate was fitted.")
    ordered = sorted(result.ranking, key=lambda each: (each.behind, each.chi2_held_out is None))
    best = ordered[0]
    most = max((each.behind for each in ordered[:MOST] if math.isfinite(each.behind)), default=0.0)
    rows = [
        (
            _named(each),
            number(each.chi2_log),
            "not judged" if each.chi2_held_out is None else number(each.chi2_held_out),
            "0 (best)" if each is best else number(each.behind),
            bar(_length(each.behind, most), "strong" if each is best or each.rival else "weak"),
            _standing(each, best),
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


def _length(behind: float, most: float) -> float:
    if not math.isfinite(behind):
        return 1.0
    return math.log1p(max(behind, 0.0)) / math.log1p(most) if most > 0 else 0.0


def _standing(candidate: Candidate, best: Candidate) -> Html:
    """The best with more beside it may fit a little better: too little for a name, so it was dropped."""
    if candidate is best:
        return element("span", "best", class_="tag")
    if candidate.rival:
        return element("span", "rival: fits as well", class_="tag bad")
    more = set(candidate.names) > set(best.names)
    return element("span", "what it adds is too little to count" if more else "falls behind")


def _others(count: int) -> Html:
    return paragraph(f"… and {count} more, further behind.") if count > 0 else Html("")
