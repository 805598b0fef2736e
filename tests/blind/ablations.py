"""`plumbline` without one of the gates of `reconcile`: what is the gate worth?

`python -m tests.blind.ablations --without drop reconcile LOG --rig RIG ...`; each takes one part away from outside, so that
the product has no switch for it.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

from gateway.cli.main import main as plumbline
from gateway.twin.reconcile import reconcile
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.evidence import Evidence, gather_evidence
from gateway.twin.reconcile.decision.ranking import RankedCandidate, rank_candidates
from gateway.twin.reconcile.fit.validation import ValidationFit
from gateway.twin.reconcile.search import baseline, persistent, stepwise_selection

Ranking = tuple[list[RankedCandidate], RankedCandidate]


@contextmanager
def isolability() -> Iterator[None]:
    """Neither fit ambiguity partners nor keep them as rivals: the best set stands alone."""

    def best_alone(*arguments: Any) -> Ranking:
        ranked, base = rank_candidates(*arguments)
        return ranked[:1], base

    with (
        patch.object(reconcile, "rank_candidates", best_alone),
        patch.object(reconcile, "indistinguishable", lambda *_: ()),
        patch.object(persistent, "partners_of", lambda *_: frozenset()),
        patch.object(stepwise_selection, "partners_of", lambda *_: frozenset()),
    ):
        yield


@contextmanager
def held_out() -> Iterator[None]:
    """Let the log alone decide; the prediction of the held-out recording is still made, to be scored."""

    def by_bic(*arguments: Any) -> Ranking:
        ranked, base = rank_candidates(*arguments)
        least = min(each.bic for each in ranked)
        by_log = [replace(each, evidence_deficit=each.bic - least) for each in ranked]
        return sorted(by_log, key=lambda each: each.bic), base

    def on_log(
        best: RankedCandidate,
        base: RankedCandidate,
        nominal: RankedCandidate,
        rivals: list[RankedCandidate],
        log: Observations,
        _selection: Observations,
        *others: Any,
        **facts: Any,
    ) -> Evidence:
        found = gather_evidence(_on_log(best), _on_log(base), _on_log(nominal), rivals, log, log, *others, **facts)
        return replace(found, best=best, baseline=base)

    def clock_is_suspect_on_log(run: reconcile.SearchRun) -> bool:
        return "clock_drift" in run.best.values and run.best.has_unexplained_residual

    with (
        patch.object(reconcile, "rank_candidates", by_bic),
        patch.object(reconcile, "gather_evidence", on_log),
        patch.object(reconcile, "_is_supported_by_selection", lambda _run, best, base, _random: best is not base),
        patch.object(reconcile, "extend_by_validation", lambda table, _context, best, *_: (table, best)),
        patch.object(reconcile, "_clock_rate_is_suspect", clock_is_suspect_on_log),
        patch.object(baseline, "MIN_REPEATED_GAIN", -float("inf")),
    ):
        yield


def _on_log(ranked: RankedCandidate) -> RankedCandidate:
    """As if the log were the recording that validates."""
    candidate = ranked.candidate
    return replace(ranked, validation=ValidationFit(candidate.fit, candidate.reduced_chi2, ()))


@contextmanager
def drop() -> Iterator[None]:
    """Keep what the search has added."""
    with patch.object(stepwise_selection, "eliminate", lambda table, _context, best: (table, best)):
        yield


ABLATIONS: Mapping[str, Callable[[], AbstractContextManager[None]]] = {
    each.__name__: each for each in (isolability, held_out, drop)
}


def main(arguments: Sequence[str] | None = None) -> int:
    """What `plumbline` returns."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.blind.ablations", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--without", choices=ABLATIONS, required=True)
    parser.add_argument("rest", nargs=argparse.REMAINDER, metavar="COMMAND ...", help="plumbline's arguments")
    chosen = parser.parse_args(arguments)
    with ABLATIONS[chosen.without]():
        return plumbline(chosen.rest)


if __name__ == "__main__":
    sys.exit(main())
