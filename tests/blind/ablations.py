"""`plumbline` without one of the parts of `reconcile`: what is the part worth?

`python -m tests.blind.ablations --without PART reconcile LOG --rig RIG ...`. `--acted FILE` instead writes which parts did
something on the recording, as JSON: without the others the answer is the same. `script/ablate` makes the table from both.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from gateway.cli.main import main as plumbline
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.evidence import rivals_of
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.validation import ValidationFit
from tests.blind.ablation import Call, Instead, Part, RuleOfVerdict

RULES = (
    "not explained",
    "found before the search",
    "nothing missing",
    "partly explained",
    "rivals",
)
"""The rules of the verdict in their order, without the last, which decides where no other does."""


def _first(_original: Instead, first: Any, *_others: Any, **_named: Any) -> Any:
    return first


def _first_and_third(_original: Instead, first: Any, _second: Any, third: Any, *_others: Any, **_named: Any) -> Any:
    return first, third


def _first_and_second(_original: Instead, first: Any, second: Any, *_others: Any, **_named: Any) -> Any:
    return first, second


def _constant(value: Any) -> Instead:
    return lambda *_arguments, **_named: value


def _best_alone(_original: Instead, ranked: Any) -> Any:
    return ranked[:1]


def _by_bic(original: Instead, *arguments: Any) -> Any:
    ranked, base = original(*arguments)
    least = min(each.bic for each in ranked)
    by_log = [replace(each, evidence_deficit=each.bic - least) for each in ranked]
    return sorted(by_log, key=lambda each: each.bic), base


class _OnLog:
    """A validator for which the log is the recording that validates."""

    def __init__(self, log: Observations) -> None:
        self.selection = log

    def evaluate(self, candidate: CandidateFit) -> ValidationFit:
        return ValidationFit(candidate.fit, candidate.reduced_chi2, ())


def _on_log(original: Instead, run: Any, ranked: Any, base: Any, **facts: Any) -> Any:
    validator = _OnLog(run.recordings.log)
    judged = [replace(each, validation=validator.evaluate(each.candidate)) for each in (*ranked, base)]
    found = original(replace(run, validator=validator), judged[:-1], judged[-1], **facts)
    return replace(found, best=ranked[0], baseline=base, rivals=rivals_of(ranked))


def _differs(_original: Instead, _run: Any, best: Any, base: Any, _random: Any) -> Any:
    return best is not base


def _unreplaced(_original: Instead, table: Any, _context: Any, _validator: Any, best: Any) -> Any:
    return table, best


def _unadded(_original: Instead, table: Any, _context: Any, base: Any) -> Any:
    return table, base


def _ungrown(_original: Instead, table: Any, _context: Any, _size: int) -> Any:
    return table, table.best


def _step(where: str) -> Call:
    """A function that takes a table first and returns it with more fits."""
    return Call(where, _first)


class _NoSubstitutes:
    """Nothing could take the place of an effect."""

    def alike(self, _name: str) -> tuple[str, ...]:
        return ()

    def alike_pairs(self, _name: str) -> tuple[tuple[str, str], ...]:
        return ()


GATES = {
    "held-out recording": Part(
        "the held-out recording has a say; without it the log alone decides",
        (
            Call("reconcile.rank_candidates", _by_bic, is_pure=False),
            Call("reconcile.gather_evidence", _on_log, is_pure=False),
            Call("reconcile._is_supported_by_selection", _differs, is_pure=False),
        ),
    ),
    "isolability": Part(
        "effects of the same signature are fitted beside each other and stay rivals",
        (
            Call("decision.evidence.rivals_of", _best_alone),
            Call("reconcile.contributions", _constant(_NoSubstitutes())),
        ),
    ),
    "same signature": Part(
        "a named effect becomes a group where another one gives the same samples",
        (Call("decision.verdict._group_indistinguishable", _first),),
    ),
    "elimination": Part(
        "effects whose absence costs nothing are dropped again",
        (Call("search.search.eliminate", _first_and_third),),
    ),
    "beyond parts": Part(
        "an effect that needs a value no part has is replaced by one of the same signature",
        (Call("reconcile.replace_implausible", _unreplaced),),
    ),
    "prior of parts": Part(
        "values that no part has count against a set", (Call("search.candidates.implausibility", _constant(0.0)),)
    ),
    "unsteady line": Part(
        "an effect of a steady frequency with lines beside it is not named",
        (Call("decision.verdict._drop_nonstationary_lines", _first),),
    ),
    "unmodelled course": Part(
        "samples inside an event whose course is not modelled count for nothing",
        (
            Call("decision.evidence.exclude_unmodelled_profiles", _first),
            Call("search.steps.exclude_unmodelled_profiles", _first),
        ),
    ),
} | {f"rule: {name}": Part("a rule of the verdict", (RuleOfVerdict(index),)) for index, name in enumerate(RULES)}
"""What stands between a set of effects and its name."""

STEPS = {
    "length of a large swing": Part(
        "a wrong length is found by the period at the amplitude",
        (Call("search.steps._add_rope_length", _unadded),),
    ),
    "length of a small swing": Part(
        "the fit of a length begins at that of the period", (_step("search.steps._fit_length_by_period"),)
    ),
    "machine line": Part(
        "a machine's line is fitted before the search",
        (Call("search.steps._add_machine_line", _first_and_second),),
    ),
    "bodies": Part(
        "a heavy rope and a pivot that yields or holds are fitted before pairs",
        (_step("search.search.fit_bodies"),),
    ),
    "pairs first": Part(
        "pairs of persistent effects are fitted before events", (_step("search.search.fit_persistent_pairs"),)
    ),
    "swap in a pair": Part(
        "the effects of a pair that explains the log are swapped", (_step("search.search._swap_in_explaining_pair"),)
    ),
    "refinement": Part(
        "fits in narrow valleys are continued, events tried shorter and longer",
        (_step("search.search.refine"),),
    ),
    "stretched events": Part("events are tried shorter and longer", (Call("search.steps._stretched", _constant(())),)),
    "growth": Part(
        "second and third effects are added to the best one",
        (Call("search.search._forward_step", _ungrown),),
    ),
    "events in windows": Part(
        "events are fitted in windows of a scan, beside the baseline and the parents of growth",
        (_step("search.search.fit_events_in_windows"),),
    ),
    "guesses from the residual": Part(
        "effects are guessed from the residual of the baseline and of the parents of growth",
        (_step("search.search.fit_guessed_effects"),),
    ),
    "swaps": Part(
        "each effect of a set is exchanged for the best others",
        (Call("search.search.try_swaps", _first_and_third),),
    ),
    "rivals with the swapped": Part(
        "sets nearly as good as one before a swap get what was swapped in",
        (_step("search.search._fit_rivals_with_swapped"),),
    ),
    "coincident effects": Part(
        "effects that coincide until a length changes are fitted where one does",
        (_step("search.search.fit_coincident_effects"),),
    ),
    "lost samples first": Part(
        "where a clock error is suspected the search begins again at true times",
        (Call("search.search.fit_clock_hypotheses", _constant(())),),
    ),
    "reversed swing": Part(
        "a start whose sign the data hide is tried both ways",
        (Call("fit.fit_context.hides_sign_of_swing", _constant(value=False)),),
    ),
}
"""What finds sets of effects."""

PARTS: Mapping[str, Part] = GATES | STEPS


def main(arguments: Sequence[str] | None = None) -> int:
    """What `plumbline` returns."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.blind.ablations", description=(__doc__ or "").splitlines()[0]
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--without", choices=PARTS)
    what.add_argument("--acted", type=Path, metavar="FILE.json", help="write which parts did something")
    parser.add_argument("rest", nargs=argparse.REMAINDER, metavar="COMMAND ...", help="plumbline's arguments")
    chosen = parser.parse_args(arguments)
    if chosen.without is not None:
        with PARTS[chosen.without].off():
            return plumbline(chosen.rest)
    code, acted = _watch(chosen.rest)
    chosen.acted.write_text(json.dumps(acted))
    return code


def _watch(arguments: Sequence[str]) -> tuple[int, list[str]]:
    acted: set[str] = set()
    with ExitStack() as stack:
        for name, part in PARTS.items():
            stack.enter_context(part.watched(partial(acted.add, name)))
        code = plumbline(arguments)
    return code, sorted(acted)


if __name__ == "__main__":
    sys.exit(main())
