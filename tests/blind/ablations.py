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
from gateway.twin.reconcile.decision import verdict
from gateway.twin.reconcile.decision.verdict import Decision, RankedCandidate, decide
from gateway.twin.reconcile.fit.validation import ValidationFit
from gateway.twin.reconcile.search import baseline, search
from gateway.twin.reconcile.search.candidate_fits import CandidateFit
from gateway.twin.reconcile.search.search import Search


@contextmanager
def isolability() -> Iterator[None]:
    """Look-alikes are neither fitted nor held as rivals: the best stands alone."""
    validate = reconcile.validate_candidates

    def alone(*arguments: Any) -> tuple[list[RankedCandidate], RankedCandidate]:
        contenders, base = validate(*arguments)
        return contenders[:1], base

    with (
        patch.object(reconcile, "validate_candidates", alone),
        patch.object(search, "ambiguity_partners", lambda _names: frozenset()),
        patch.object(verdict, "UNOBSERVABLE_YAW_EFFECTS", frozenset()),
    ):
        yield


@contextmanager
def held_out() -> Iterator[None]:
    """The log alone decides; the prediction of the held-out recording is still made, to be scored."""
    add_line = baseline.add_machine_line

    def on_log(
        contenders: Sequence[RankedCandidate],
        base: RankedCandidate,
        log: Observations,
        _held_out: Observations,
        *others: Any,
    ) -> Decision:
        least = min(each.bic for each in contenders)
        ranked = sorted(contenders, key=lambda each: each.bic)
        answer = decide([_fitted(each, least) for each in ranked], _fitted(base, least), log, log, *others)
        model = next(each for each in (*ranked, base) if each.candidate is answer.model.candidate)
        return replace(answer, model=model)

    def line_on_log(search: Search, base: CandidateFit, always: reconcile.Values, _held_out: Observations) -> Any:
        return add_line(search, base, always, search.setting.log)

    def slow_on_log(_search: Search, best: CandidateFit, _held_out: Observations) -> bool:
        return "clock_drift" in best.values and best.has_unexplained_residual

    with (
        patch.object(reconcile, "decide", on_log),
        patch.object(reconcile, "extend_by_validation_residual", lambda _search, best, *_others: best),
        patch.object(reconcile, "_clock_rate_is_suspect", slow_on_log),
        patch.object(baseline, "add_machine_line", line_on_log),
    ):
        yield


def _fitted(contender: RankedCandidate, least_bic: float) -> RankedCandidate:
    """As if the recording that it was fitted to were the one to judge it."""
    attempt = contender.candidate
    return replace(
        contender,
        validation=ValidationFit(attempt.fit, attempt.reduced_chi2, ()),
        evidence_deficit=max(0.0, contender.bic - least_bic),
    )


@contextmanager
def drop() -> Iterator[None]:
    """What was added stays."""
    with patch.object(Search, "_backward_elimination", lambda _search, best: best):
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
