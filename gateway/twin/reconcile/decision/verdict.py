"""From the models that were fitted and judged to one answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gateway.twin.reconcile.changepoints.changepoint_scan import exclude_unmodelled_profiles
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.ambiguity_groups import UNOBSERVABLE_YAW_EFFECTS, group_of
from gateway.twin.reconcile.fit.validation import ValidationFit, block_bootstrap_gain
from gateway.twin.reconcile.output.result import Verdict
from gateway.twin.reconcile.residual.residual_tests import has_excess, has_lines, residual_lines
from gateway.twin.reconcile.search.candidate_fits import MIN_VARIANCE_SHARE, CandidateFit

MIN_EVIDENCE_MARGIN = 12.0
"""Evidence, in chi-square over the noise's colour, below which one model is no better than another: odds of 400 to 1."""
MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE = 20.0
"""The same for two effects whose signatures coincide: between their fits a wrong one has been ahead by 6."""
MIN_GAP_CLOSED = 0.99
"""Share of the held-out gap that a model must close for its effects to keep their names beside an unexplained remainder."""
MIN_GAP_CLOSED_BOTH, MIN_GAP_CLOSED_VALIDATION = 0.999, 0.95
"""Of a wide swing also this share of both recordings' gaps together and that of the held-out one alone: a swing that dies away
leaves little of the gap to a held-out end of it."""
MIN_NECESSARY_SHARE = 0.1
"""Share of the gap that an effect must hold open by its absence to be named beside a remainder."""
MIN_NECESSARY_RATIO = 30.0
"""Of a wide swing also by how many times as much its absence leaves: the first loss alone closes nearly all of its gap."""
MAX_AMBIGUOUS = 4
SAME_LINE_CYCLES = 3.0
"""Turns in the recording by which two lines may differ and yet be one that swells and fades."""
AXIS_COUPLING_EFFECTS = frozenset({"cross_axis", "mount_misalignment"})
"""An unsymmetrical pick-up is a symmetrical one and a turn: beside the first, nothing tells the turn from it."""

TIME_SCALING_EFFECTS = frozenset({"clock_drift", "rope_length"})
"""Beside something unexplained these have no name: whatever makes time wander runs slow on the whole."""


@dataclass(frozen=True, slots=True)
class RankedCandidate:
    """A model with all its evidence."""

    candidate: CandidateFit
    validation: ValidationFit
    bic: float
    evidence_deficit: float

    @property
    def names(self) -> frozenset[str]:
        """Its effects."""
        return self.candidate.names


@dataclass(frozen=True, slots=True)
class Decision:
    """What is said, and of which model."""

    verdict: Verdict
    reason: str
    model: RankedCandidate
    """Whose parameters and prediction are given."""
    named: tuple[str, ...]
    candidates: tuple[str, ...]


def decide(
    contenders: Sequence[RankedCandidate],
    base: RankedCandidate,
    log: Observations,
    held_out: Observations,
    always: frozenset[str],
    seen: frozenset[str],
    fitted: Mapping[frozenset[str], CandidateFit],
    rng: np.random.Generator,
    alike: frozenset[frozenset[str]],
) -> Decision:
    """Contenders best first; the base has nothing but what is always there; `seen` was found outside the models.

    `alike` are pairs of effects whose signatures coincide.
    """
    rivals = competitive_models(contenders, alike)
    answer = _decide_between_models(contenders[0], rivals, base, log, held_out, always, fitted, rng, bool(seen))
    answer = remove_unidentifiable(_drop_nonstationary_lines(answer, log))
    if answer.verdict not in ("named", "one_of"):
        return answer  # beside something unexplained, a time that wanders may be that, too
    return replace(answer, named=tuple(sorted({*answer.named, *seen})))


def _drop_nonstationary_lines(answer: Decision, log: Observations) -> Decision:
    """An effect that leaves lines close to its own frequency is not what is there: that swells or dies away otherwise."""
    attempt = answer.model.candidate
    if not has_lines(log, attempt.fit):
        return answer
    left_hz = np.array([line.hz for line in residual_lines(log, attempt.fit)])
    near_hz = SAME_LINE_CYCLES / log.duration_s
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


def competitive_models(
    contenders: Sequence[RankedCandidate], alike: frozenset[frozenset[str]]
) -> list[RankedCandidate]:
    """The best one and all that come near it."""
    best = contenders[0]
    return [
        c
        for c in contenders
        if c.evidence_deficit
        < (MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE if c.names ^ best.names in alike else MIN_EVIDENCE_MARGIN)
    ]


def _decide_between_models(
    best: RankedCandidate,
    rivals: Sequence[RankedCandidate],
    base: RankedCandidate,
    log: Observations,
    held_out: Observations,
    always: frozenset[str],
    fitted: Mapping[frozenset[str], CandidateFit],
    rng: np.random.Generator,
    seen: bool,
) -> Decision:
    wide = log.has_large_amplitude
    log, held_out = (exclude_unmodelled_profiles(each, best.candidate.values) for each in (log, held_out))
    is_open = has_excess(log, best.candidate.fit) or has_excess(held_out, best.validation.fit)
    if best.names == always:
        return _decide_for_baseline(best, always, is_open, seen)
    if not _improves_validation(best, base, held_out, rng):
        return _decide_for_baseline(base, always, has_excess(log, base.candidate.fit), seen)
    if is_open:
        return decide_with_residual(best, base, rivals, always, fitted, wide=wide)
    if len(best.names - always) > 1:
        leading = _necessary_effects(best, base, fitted)
        bends = (
            len(best.names - always) > 2
            or has_lines(log, best.candidate.fit)
            or has_lines(held_out, best.validation.fit)
        )
        if leading != best.names and bends:
            text = "what else was tried only bends the model to what is left, and something is left"
            verdict: Verdict = "named_with_remainder" if leading else "unmodelled"
            return Decision(verdict, text, best, tuple(sorted(leading)), ())
    return _decide_named(best, rivals, always)


def _necessary_effects(
    best: RankedCandidate, base: RankedCandidate, fitted: Mapping[frozenset[str], CandidateFit], *, wide: bool = False
) -> frozenset[str]:
    """Effects without which much more is left: those that have a share of their own in closing the gap."""
    closed = base.candidate.fit.chi2 - best.candidate.fit.chi2
    found = set(base.names)
    for name in best.names - base.names:
        without = fitted.get(best.names - {name})
        if without is None:
            found.add(name)
            continue
        holds_open = without.fit.chi2 - best.candidate.fit.chi2 > MIN_NECESSARY_SHARE * closed
        if holds_open or (wide and without.reduced_chi2 > MIN_NECESSARY_RATIO * best.candidate.reduced_chi2):
            found.add(name)
    return frozenset(found)


def _decide_for_baseline(base: RankedCandidate, always: frozenset[str], is_open: bool, seen: bool) -> Decision:
    named = tuple(sorted(always))
    if is_open:
        text = "the model as believed does not explain the data, and no effect of the catalogue does"
        return Decision("named_with_remainder" if named else "unmodelled", text, base, named, ())
    if named or seen:
        return Decision("named", "seen in the readings themselves; nothing else is missing", base, named, ())
    return Decision("none_missing", "the model as believed explains both recordings down to the noise", base, (), ())


def decide_with_residual(
    best: RankedCandidate,
    base: RankedCandidate,
    rivals: Sequence[RankedCandidate],
    always: frozenset[str],
    fitted: Mapping[frozenset[str], CandidateFit],
    *,
    wide: bool,
) -> Decision:
    """Where something is left: the effects that hold the gap open by their absence, if with them nearly all of it is closed."""
    closed = (base.validation.reduced_chi2 - best.validation.reduced_chi2) / max(base.validation.reduced_chi2 - 1, 1e-9)
    shared = _necessary_effects(best, base, fitted, wide=wide) - TIME_SCALING_EFFECTS
    if shared - always and _closes_gap(best, base, closed, wide=wide) and len(rivals) == 1:
        text = f"these close {100 * closed:.1f} % of the held-out gap; what is left is described, not explained"
        return Decision("named_with_remainder", text, best, tuple(sorted(shared)), ())
    text = "no effect of the catalogue, alone or in pairs, explains the data on the held-out recording"
    return Decision("unmodelled", text, best, tuple(sorted(always)), ())


def _closes_gap(best: RankedCandidate, base: RankedCandidate, closed_on_held_out: float, *, wide: bool) -> bool:
    """Nearly all of the gap is closed."""
    if closed_on_held_out > MIN_GAP_CLOSED or not wide:
        return closed_on_held_out > MIN_GAP_CLOSED
    before, after = (
        base.candidate.reduced_chi2 + base.validation.reduced_chi2,
        best.candidate.reduced_chi2 + best.validation.reduced_chi2,
    )
    of_both = (before - after) / max(before - 2, 1e-9)
    return of_both > MIN_GAP_CLOSED_BOTH and closed_on_held_out > MIN_GAP_CLOSED_VALIDATION


def _decide_named(best: RankedCandidate, rivals: Sequence[RankedCandidate], always: frozenset[str]) -> Decision:
    if len(rivals) > 1:
        return _one_of(best, rivals, always)
    return Decision(
        "named", "explains both recordings down to the noise; nothing else does", best, _sorted(best.names), ()
    )


def remove_unidentifiable(answer: Decision) -> Decision:
    """Without what no recording tells, whatever a fit says: whether crane or housing turns, and a turn beside a pick-up."""
    named = frozenset(answer.named)
    if named >= AXIS_COUPLING_EFFECTS:
        text = "certain; beside it the housing is askew, or the pick-up is not the same both ways"
        kept = _sorted(named - {"mount_misalignment"})
        answer = replace(answer, verdict="named_with_remainder", reason=text, named=kept)
    if not named & UNOBSERVABLE_YAW_EFFECTS:
        return answer
    text = "the crane slews or the housing spins, and no recording tells these apart"
    kept = _sorted(frozenset(answer.named) - UNOBSERVABLE_YAW_EFFECTS)
    left: Verdict = "named_with_remainder" if kept else "unmodelled"
    if answer.verdict != "named":
        text += "; beside that something is left"
    verdict: Verdict = "one_of" if answer.verdict == "named" else left
    return replace(answer, verdict=verdict, reason=text, named=kept, candidates=_sorted(UNOBSERVABLE_YAW_EFFECTS))


def _one_of(best: RankedCandidate, rivals: Sequence[RankedCandidate], always: frozenset[str]) -> Decision:
    """Of several that no evidence decides between."""
    everywhere = frozenset.intersection(*(c.names for c in rivals))
    different = frozenset().union(*(c.names for c in rivals)) - everywhere
    certain = _sorted(everywhere | always)
    if all(len(c.names - everywhere) == 1 for c in rivals) and len(different) <= MAX_AMBIGUOUS:
        group = group_of(different)
        text = "these explain the data equally well" + (
            "" if group else ", and no group of the catalogue holds them all"
        )
        return Decision("one_of", text, best, certain, _sorted(different))
    if everywhere - always:
        return Decision("named_with_remainder", "certain; what acts beside it is not decided", best, certain, ())
    text = "several sets explain the data equally well"
    return Decision("one_of", text, best, certain, _sorted(different)[:MAX_AMBIGUOUS])


def _sorted(names: frozenset[str]) -> tuple[str, ...]:
    return tuple(sorted(names))


def is_needed(before: ValidationFit, after: ValidationFit, held_out: Observations, rng: np.random.Generator) -> bool:
    """Less is left on the held-out recording, by more than chance and enough to matter."""
    low, _ = block_bootstrap_gain(
        held_out.residual_sigma(before.fit.force_g), held_out.residual_sigma(after.fit.force_g), held_out.time_s, rng
    )
    return low > 0 and before.reduced_chi2 - after.reduced_chi2 > MIN_VARIANCE_SHARE


def _improves_validation(
    best: RankedCandidate, base: RankedCandidate, held_out: Observations, rng: np.random.Generator
) -> bool:
    return is_needed(base.validation, best.validation, held_out, rng)
