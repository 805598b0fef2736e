"""From the models that were fitted and judged to one answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gateway.twin.reconcile.changepoints.changepoint_scan import outside_events
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.ambiguity_groups import TURNING, group_of
from gateway.twin.reconcile.fit.validation import Judged, taken_off
from gateway.twin.reconcile.fit.windowed_fit import is_wide
from gateway.twin.reconcile.output.result import Verdict
from gateway.twin.reconcile.residual.residual_tests import left_open, lines, structured
from gateway.twin.reconcile.search.candidate_fits import LEAST_EFFECT, Attempt

RIVAL = 12.0
"""Evidence, in chi-square over the noise's colour, below which one model is no better than another: odds of 400 to 1."""
ALIKE_RIVAL = 20.0
"""The same for two effects whose signatures coincide: between their fits a wrong one has been ahead by 6."""
EXPLAINED = 0.99
"""Share of the held-out gap that a model must close for its effects to keep their names beside an unexplained remainder."""
EXPLAINED_OF_BOTH, EXPLAINED_AT_LEAST = 0.999, 0.95
"""Of a wide swing also this share of both recordings' gaps together and that of the held-out one alone: a swing that dies away
leaves little of the gap to a held-out end of it."""
LEADING = 0.1
"""Share of the gap that an effect must hold open by its absence to be named beside a remainder."""
LEFT_WITHOUT = 30.0
"""Of a wide swing also by how many times as much its absence leaves: the first loss alone closes nearly all of its gap."""
MOST_CANDIDATES = 4
NEAR_LINE = 3.0
"""Turns in the recording by which two lines may differ and yet be one that swells and fades."""
PICK_UP = frozenset({"cross_axis", "mount_misalignment"})
"""An unsymmetrical pick-up is a symmetrical one and a turn: beside the first, nothing tells the turn from it."""

PACE = frozenset({"clock_drift", "rope_length"})
"""Beside something unexplained these have no name: whatever makes time wander runs slow on the whole."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A model with all its evidence."""

    attempt: Attempt
    judged: Judged
    bic: float
    behind: float

    @property
    def names(self) -> frozenset[str]:
        """Its effects."""
        return self.attempt.names


@dataclass(frozen=True, slots=True)
class Answer:
    """What is said, and of which model."""

    verdict: Verdict
    reason: str
    model: Contender
    """Whose parameters and prediction are given."""
    named: tuple[str, ...]
    candidates: tuple[str, ...]


def decide(
    contenders: Sequence[Contender],
    base: Contender,
    log: Observations,
    held_out: Observations,
    always: frozenset[str],
    seen: frozenset[str],
    fitted: Mapping[frozenset[str], Attempt],
    rng: np.random.Generator,
    alike: frozenset[frozenset[str]],
) -> Answer:
    """Contenders best first; the base has nothing but what is always there; `seen` was found outside the models.

    `alike` are pairs of effects whose signatures coincide.
    """
    rivals = rivals_of(contenders, alike)
    answer = _of_models(contenders[0], rivals, base, log, held_out, always, fitted, rng, bool(seen))
    answer = told_apart(_without_unsteady(answer, log))
    if answer.verdict not in ("named", "one_of"):
        return answer  # beside something unexplained, a time that wanders may be that, too
    return replace(answer, named=tuple(sorted({*answer.named, *seen})))


def _without_unsteady(answer: Answer, log: Observations) -> Answer:
    """An effect that leaves lines close to its own frequency is not what is there: that swells or dies away otherwise."""
    attempt = answer.model.attempt
    if not structured(log, attempt.fit):
        return answer
    left_hz = np.array([line.hz for line in lines(log, attempt.fit)])
    near_hz = NEAR_LINE / log.duration_s
    unsteady = {
        name
        for name, values in attempt.values.items()
        if "frequency_hz" in values and (np.abs(left_hz - np.asarray(values["frequency_hz"])) < near_hz).any()
    }
    named = tuple(name for name in answer.named if name not in unsteady)
    if named == answer.named:
        return answer
    text = (
        f"what is left has lines beside that of {', '.join(sorted(unsteady))}: this one swells, or dies away otherwise"
    )
    return replace(answer, verdict="named_with_remainder" if named else "unmodelled", reason=text, named=named)


def rivals_of(contenders: Sequence[Contender], alike: frozenset[frozenset[str]]) -> list[Contender]:
    """The best one and all that come near it."""
    best = contenders[0]
    return [c for c in contenders if c.behind < (ALIKE_RIVAL if c.names ^ best.names in alike else RIVAL)]


def _of_models(
    best: Contender,
    rivals: Sequence[Contender],
    base: Contender,
    log: Observations,
    held_out: Observations,
    always: frozenset[str],
    fitted: Mapping[frozenset[str], Attempt],
    rng: np.random.Generator,
    seen: bool,
) -> Answer:
    wide = is_wide(log)
    log, held_out = (outside_events(each, best.attempt.values) for each in (log, held_out))
    is_open = left_open(log, best.attempt.fit) or left_open(held_out, best.judged.fit)
    if best.names == always:
        return _of_base(best, always, is_open, seen)
    if not _helps_on_held_out(best, base, held_out, rng):
        return _of_base(base, always, left_open(log, base.attempt.fit), seen)
    if is_open:
        return beside_a_remainder(best, base, rivals, always, fitted, wide=wide)
    if len(best.names - always) > 1:
        leading = _leading(best, base, fitted)
        bends = (
            len(best.names - always) > 2 or structured(log, best.attempt.fit) or structured(held_out, best.judged.fit)
        )
        if leading != best.names and bends:
            text = "what else was tried only bends the model to what is left, and something is left"
            verdict: Verdict = "named_with_remainder" if leading else "unmodelled"
            return Answer(verdict, text, best, tuple(sorted(leading)), ())
    return _named(best, rivals, always)


def _leading(
    best: Contender, base: Contender, fitted: Mapping[frozenset[str], Attempt], *, wide: bool = False
) -> frozenset[str]:
    """Effects without which much more is left: those that have a share of their own in closing the gap."""
    closed = base.attempt.fit.chi2 - best.attempt.fit.chi2
    found = set(base.names)
    for name in best.names - base.names:
        without = fitted.get(best.names - {name})
        if without is None:
            found.add(name)
            continue
        holds_open = without.fit.chi2 - best.attempt.fit.chi2 > LEADING * closed
        if holds_open or (wide and without.reduced > LEFT_WITHOUT * best.attempt.reduced):
            found.add(name)
    return frozenset(found)


def _of_base(base: Contender, always: frozenset[str], is_open: bool, seen: bool) -> Answer:
    named = tuple(sorted(always))
    if is_open:
        text = "the model as believed does not explain the data, and no effect of the catalogue does"
        return Answer("named_with_remainder" if named else "unmodelled", text, base, named, ())
    if named or seen:
        return Answer("named", "seen in the readings themselves; nothing else is missing", base, named, ())
    return Answer("none_missing", "the model as believed explains both recordings down to the noise", base, (), ())


def beside_a_remainder(
    best: Contender,
    base: Contender,
    rivals: Sequence[Contender],
    always: frozenset[str],
    fitted: Mapping[frozenset[str], Attempt],
    *,
    wide: bool,
) -> Answer:
    """Where something is left: the effects that hold the gap open by their absence, if with them nearly all of it is closed."""
    closed = (base.judged.reduced - best.judged.reduced) / max(base.judged.reduced - 1, 1e-9)
    shared = _leading(best, base, fitted, wide=wide) - PACE
    if shared - always and _explained(best, base, closed, wide=wide) and len(rivals) == 1:
        text = f"these close {100 * closed:.1f} % of the held-out gap; what is left is described, not explained"
        return Answer("named_with_remainder", text, best, tuple(sorted(shared)), ())
    text = "no effect of the catalogue, alone or in pairs, explains the data on the held-out recording"
    return Answer("unmodelled", text, best, tuple(sorted(always)), ())


def _explained(best: Contender, base: Contender, closed_on_held_out: float, *, wide: bool) -> bool:
    """Nearly all of the gap is closed."""
    if closed_on_held_out > EXPLAINED or not wide:
        return closed_on_held_out > EXPLAINED
    before, after = base.attempt.reduced + base.judged.reduced, best.attempt.reduced + best.judged.reduced
    of_both = (before - after) / max(before - 2, 1e-9)
    return of_both > EXPLAINED_OF_BOTH and closed_on_held_out > EXPLAINED_AT_LEAST


def _named(best: Contender, rivals: Sequence[Contender], always: frozenset[str]) -> Answer:
    if len(rivals) > 1:
        return _among(best, rivals, always)
    return Answer(
        "named", "explains both recordings down to the noise; nothing else does", best, _sorted(best.names), ()
    )


def told_apart(answer: Answer) -> Answer:
    """Without what no recording tells, whatever a fit says: whether crane or housing turns, and a turn beside a pick-up."""
    named = frozenset(answer.named)
    if named >= PICK_UP:
        text = "certain; beside it the housing is askew, or the pick-up is not the same both ways"
        kept = _sorted(named - {"mount_misalignment"})
        answer = replace(answer, verdict="named_with_remainder", reason=text, named=kept)
    if not named & TURNING:
        return answer
    text = "the crane slews or the housing spins, and no recording tells these apart"
    kept = _sorted(frozenset(answer.named) - TURNING)
    left: Verdict = "named_with_remainder" if kept else "unmodelled"
    if answer.verdict != "named":
        text += "; beside that something is left"
    verdict: Verdict = "one_of" if answer.verdict == "named" else left
    return replace(answer, verdict=verdict, reason=text, named=kept, candidates=_sorted(TURNING))


def _among(best: Contender, rivals: Sequence[Contender], always: frozenset[str]) -> Answer:
    """Of several that no evidence decides between."""
    everywhere = frozenset.intersection(*(c.names for c in rivals))
    different = frozenset().union(*(c.names for c in rivals)) - everywhere
    certain = _sorted(everywhere | always)
    if all(len(c.names - everywhere) == 1 for c in rivals) and len(different) <= MOST_CANDIDATES:
        group = group_of(different)
        text = "these explain the data equally well" + (
            "" if group else ", and no group of the catalogue holds them all"
        )
        return Answer("one_of", text, best, certain, _sorted(different))
    if everywhere - always:
        return Answer("named_with_remainder", "certain; what acts beside it is not decided", best, certain, ())
    text = "several sets explain the data equally well"
    return Answer("one_of", text, best, certain, _sorted(different)[:MOST_CANDIDATES])


def _sorted(names: frozenset[str]) -> tuple[str, ...]:
    return tuple(sorted(names))


def helps(before: Judged, after: Judged, held_out: Observations, rng: np.random.Generator) -> bool:
    """Less is left on the held-out recording, by more than chance and enough to matter."""
    low, _ = taken_off(
        held_out.residual_sigma(before.fit.force_g), held_out.residual_sigma(after.fit.force_g), held_out.time_s, rng
    )
    return low > 0 and before.reduced - after.reduced > LEAST_EFFECT


def _helps_on_held_out(best: Contender, base: Contender, held_out: Observations, rng: np.random.Generator) -> bool:
    return helps(base.judged, best.judged, held_out, rng)
