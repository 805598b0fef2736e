"""The effects considered: score test before fitting, candidates after it."""

import math
from dataclasses import dataclass

from gateway.documents.format import format_number, format_percent
from gateway.documents.text import human_name, join_names
from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Candidate, Reconciliation, ScoreTestResult
from gateway.twin.report.models import NOMINAL

MOST = 10


@dataclass(frozen=True, slots=True)
class ScoreRow:
    """The score test of an effect."""

    effect: str
    share: str
    bar_percent: str
    statistic: str
    threshold: str
    is_significant: bool


@dataclass(frozen=True, slots=True)
class CandidateRow:
    """A set of effects that was fitted."""

    effects: str
    gap_log: str
    gap_held_out: str
    deficit: str
    bar_percent: str
    assessment: str
    """best, rival, trifle or worse."""


@dataclass(frozen=True, slots=True)
class RankingView:
    """The section as it is printed."""

    scores: tuple[ScoreRow, ...]
    more_scores: int
    scores_transient: bool
    """Transient effects are among those that were tested."""
    candidates: tuple[CandidateRow, ...]
    more_candidates: int
    none_explains: bool


def ranking_view(result: Reconciliation) -> RankingView:
    """Return the largest scores, and the best candidates."""
    scores = sorted(result.scores, key=lambda each: -each.drop)
    candidates = sorted(result.ranking, key=lambda each: (each.behind, each.chi2_held_out is None))
    return RankingView(
        scores=tuple(_score_row(each) for each in scores[:MOST]),
        more_scores=max(0, len(scores) - MOST),
        scores_transient=any(_is_transient(each.name) for each in scores),
        candidates=_candidate_rows(candidates[:MOST]),
        more_candidates=max(0, len(candidates) - MOST),
        none_explains=result.verdict == "unmodelled",
    )


def _is_transient(name: str) -> bool:
    known = EFFECTS.get(name)
    return known is not None and known.transient


def _score_row(scored: ScoreTestResult) -> ScoreRow:
    return ScoreRow(
        effect=human_name(scored.name),
        share=format_percent(100 * scored.drop),
        bar_percent=_bar_percent(scored.drop),
        statistic=format_number(scored.statistic),
        threshold=format_number(scored.threshold),
        is_significant=scored.statistic > scored.threshold,
    )


def _candidate_rows(candidates: list[Candidate]) -> tuple[CandidateRow, ...]:
    if not candidates:
        return ()
    best = candidates[0]
    most = max((each.behind for each in candidates if math.isfinite(each.behind)), default=0.0)
    return tuple(
        CandidateRow(
            effects=join_names(each.names) if each.names else NOMINAL,
            gap_log=format_number(each.chi2_log),
            gap_held_out="not evaluated" if each.chi2_held_out is None else format_number(each.chi2_held_out),
            deficit="0 (best)" if each is best else format_number(each.behind),
            bar_percent=_bar_percent(_length(each.behind, most)),
            assessment=_assessment(each, best),
        )
        for each in candidates
    )


def _length(behind: float, most: float) -> float:
    """Return the length of a bar on a logarithmic scale, as a share of the longest."""
    if not math.isfinite(behind):
        return 1.0
    return math.log1p(max(behind, 0.0)) / math.log1p(most) if most > 0 else 0.0


def _assessment(candidate: Candidate, best: Candidate) -> str:
    """Return the class of a candidate.

    The best set with more effects may fit a little better: too little for a name, so the addition was dropped.
    """
    if candidate is best:
        return "best"
    if candidate.rival:
        return "rival"
    return "trifle" if set(candidate.names) > set(best.names) else "worse"


def _bar_percent(share: float) -> str:
    return f"{100 * min(max(share, 0.0), 1.0):.1f}"
