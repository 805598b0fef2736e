"""The verdict: a table of rules over the evidence, then corrections for what no recording separates."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from itertools import chain

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Effect
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.evidence import Evidence, RankedCandidate
from gateway.twin.reconcile.decision.identifiability import Substitutes
from gateway.twin.reconcile.output.result import Verdict
from gateway.twin.reconcile.residual import SAME_LINE_CYCLES, has_lines, residual_lines
from gateway.twin.reconcile.search.candidates import LITTLE_OF_GAP, MOST_OF_GAP

PARTIAL = ("named_with_remainder", "unmodelled")
"""Verdicts that leave something unexplained."""
MIN_CLOSED_BY_EVENT = 0.99
"""Share of the gap from which on an event is named beside a remainder: of a motion that no model follows, each event explains a
part."""
MAX_AMBIGUOUS = 4
"""Candidates of a one_of verdict, those with the most evidence; more would be no answer."""
MAX_COINCIDENCES = 2
"""Pairs of effects that are stated for a named effect, the closest ones."""


class VerdictReason(Enum):
    """Why a verdict was given; the value is the sentence that users read."""

    NOTHING_MISSING = "The nominal model explains both recordings down to the noise."
    FOUND_BEFORE_SEARCH = "The samples themselves show it; nothing else is missing."
    NOT_EXPLAINED = "The nominal model does not explain the data, and no effect of the vocabulary does."
    PARTLY = "These effects close {share} of the gap, without each of them far more is left; a residual remains."
    NO_SET_EXPLAINS = "No effect of the vocabulary, alone or with others, explains the held-out data."
    RIVALS_IN_ONE_PLACE = "These effects explain the data equally well."
    SEVERAL_SETS = "Several sets of effects explain the data equally well."
    UNIQUE = "These effects explain both recordings down to the noise; nothing else does."
    DOUBTFUL = "The data are explained down to the noise only by a value at its edge, or by one that no part has."
    BEST_SO_FAR = "These effects explain both recordings down to the noise; others were not tried."
    NONSTATIONARY_LINE = "The residual has lines near that of {names}: its amplitude or frequency changes."
    INDISTINGUISHABLE = "These effects have the same signature: no recording of this kind separates them."


@dataclass(frozen=True, slots=True)
class Decision:
    """The verdict, and the model that it is about."""

    verdict: Verdict
    reason: VerdictReason
    text: str
    """The reason as a sentence."""
    model: RankedCandidate
    """The set of effects whose parameters and prediction are given."""
    named: tuple[str, ...]
    candidates: tuple[str, ...] = ()
    sets: tuple[tuple[str, ...], ...] = ()
    """How the candidates act together, where one alone does not explain the data."""
    also_one_of: tuple[tuple[str, ...], ...] = ()
    """Further groups, of each of which one effect acts as well."""
    leaves_remainder: bool = False
    """Something is left that neither a name nor a group explains."""

    @property
    def known(self) -> frozenset[str]:
        """The effects that are named, and those of the groups."""
        return frozenset((*self.named, *self.candidates)).union(*self.also_one_of)


@dataclass(frozen=True, slots=True)
class Rule:
    """A condition on the evidence and what follows from it."""

    applies: Callable[[Evidence], bool]
    conclude: Callable[[Evidence], Decision]


def _make(
    verdict: Verdict,
    reason: VerdictReason,
    model: RankedCandidate,
    named: frozenset[str],
    candidates: tuple[str, ...] = (),
) -> Decision:
    """Decide on a model; what it does not have, because it was eliminated, is not named."""
    known = tuple(sorted(named & model.names))
    return Decision(verdict, reason, reason.value, model, known, candidates, leaves_remainder=verdict in PARTIAL)


def _baseline_wins(evidence: Evidence) -> bool:
    return evidence.best.names == evidence.baseline.names or not evidence.improves_selection


def _baseline_unexplained(evidence: Evidence) -> bool:
    if evidence.best.names == evidence.baseline.names:
        return evidence.best_leaves_excess
    return not evidence.improves_selection and evidence.baseline_leaves_excess


def _conclude_unexplained(evidence: Evidence) -> Decision:
    verdict: Verdict = "named_with_remainder" if evidence.baseline_closes_gap else "unmodelled"
    return _make(verdict, VerdictReason.NOT_EXPLAINED, evidence.baseline, evidence.baseline.names)


def _certain_beside_remainder(evidence: Evidence) -> frozenset[str]:
    """Return the effects of all rival sets that are necessary, possible, and no imitation of what is left.

    A remainder can change the swing's rate, and what few rigs have imitates it unless hardly any of the gap is left.
    """
    found = (
        (evidence.necessary & _everywhere(evidence))
        - evidence.baseline.names
        - evidence.beyond_parts
        - evidence.at_edge
    )
    return frozenset(
        name for name in found if not EFFECTS[name].scales_period and evidence.share_closed > _min_closed(EFFECTS[name])
    )


def _min_closed(effect: Effect) -> float:
    """Of a reading that is not linear what few rigs have, such as a loose housing, explains a part."""
    if effect.transient:
        return MIN_CLOSED_BY_EVENT
    return MOST_OF_GAP if effect.is_usual else 1 - LITTLE_OF_GAP


def _conclude_partly(evidence: Evidence) -> Decision:
    """Name what is certain; the effects in which rivals differ are candidates. What the samples show explains nothing else."""
    certain = _certain_beside_remainder(evidence)
    is_necessary = evidence.best.names - _everywhere(evidence) <= evidence.necessary
    differ = _rivals_differ_in_one_place(evidence) and is_necessary and evidence.share_closed > MOST_OF_GAP
    group = _contested(evidence) if differ else ()
    if not certain and not group:
        return _make("unmodelled", VerdictReason.NO_SET_EXPLAINS, evidence.best, evidence.baseline.names)
    named = certain | (evidence.baseline.names & evidence.necessary)
    decision = _make("named_with_remainder", VerdictReason.PARTLY, evidence.best, named, group)
    text = VerdictReason.PARTLY.value.format(share=f"{100 * evidence.share_closed:.3g} %")
    return replace(decision, verdict="named_with_remainder" if named else "one_of", text=text)


def _conclude_doubtful(evidence: Evidence) -> Decision:
    """Name all but the effects at an edge: what the fit looks for lies beyond it, and is something else."""
    named = evidence.best.names - evidence.at_edge | evidence.baseline.names
    verdict: Verdict = "named_with_remainder" if named - evidence.baseline.names else "unmodelled"
    return _make(verdict, VerdictReason.DOUBTFUL, evidence.best, named)


def _everywhere(evidence: Evidence) -> frozenset[str]:
    """Effects that all rival sets have."""
    return frozenset.intersection(*(each.names for each in evidence.rivals))


def _contested(evidence: Evidence) -> tuple[str, ...]:
    """Effects that some rival sets have and others do not, those of the best set first, then in the order of the evidence."""
    everywhere = _everywhere(evidence)
    return tuple(dict.fromkeys(name for each in evidence.rivals for name in sorted(each.names - everywhere)))


def _rivals_differ_in_one_place(evidence: Evidence) -> bool:
    everywhere = _everywhere(evidence)
    one_each = all(len(each.names - everywhere) == 1 for each in evidence.rivals)
    return len(evidence.rivals) > 1 and one_each and len(_contested(evidence)) <= MAX_AMBIGUOUS


def _conclude_rivals(evidence: Evidence) -> Decision:
    """Name what all rival sets have; the others are candidates."""
    one_place = _rivals_differ_in_one_place(evidence)
    reason = VerdictReason.RIVALS_IN_ONE_PLACE if one_place else VerdictReason.SEVERAL_SETS
    everywhere, candidates = _everywhere(evidence), _contested(evidence)[:MAX_AMBIGUOUS]
    decision = _make("one_of", reason, evidence.best, everywhere | evidence.baseline.names, candidates)
    sets = tuple(
        tuple(sorted(each.names - everywhere)) for each in evidence.rivals if each.names <= {*everywhere, *candidates}
    )
    return replace(decision, sets=sets if any(len(each) > 1 for each in sets) else ())


RULES = (
    Rule(lambda e: _baseline_wins(e) and _baseline_unexplained(e), _conclude_unexplained),
    Rule(
        lambda e: _baseline_wins(e) and bool(e.baseline.names or e.detected),
        lambda e: _make("named", VerdictReason.FOUND_BEFORE_SEARCH, e.baseline, e.baseline.names),
    ),
    Rule(_baseline_wins, lambda e: _make("none_missing", VerdictReason.NOTHING_MISSING, e.baseline, frozenset())),
    Rule(lambda e: e.best_leaves_excess, _conclude_partly),
    Rule(lambda e: len(e.rivals) > 1, _conclude_rivals),
    Rule(lambda e: bool((e.beyond_parts | e.at_edge) - e.baseline.names), _conclude_doubtful),
    Rule(lambda _: True, lambda e: _make("named", VerdictReason.UNIQUE, e.best, e.best.names)),
)
"""The first rule that applies gives the verdict."""


def decide(evidence: Evidence, log: Observations, linearise: Callable[[], Substitutes]) -> Decision:
    """Decide by the first rule that applies, then correct for what no recording separates.

    `linearise` tells which effects could take the place of one of the best set.
    """
    decision = next(rule.conclude(evidence) for rule in RULES if rule.applies(evidence))
    decision = _drop_nonstationary_lines(decision, log)
    decision = _group_indistinguishable(decision, evidence.baseline.names, linearise)
    if decision.verdict not in ("named", "one_of"):
        return decision  # where a residual remains, it may be what was detected in the time stamps
    if decision.reason is VerdictReason.UNIQUE:
        decision = _state_coincidences(decision, linearise())
    return replace(decision, named=tuple(sorted({*decision.named, *evidence.detected})))


ENDED_EARLY = "The search was ended early: this is the best answer so far."
NOT_YET = "The nominal model does not explain the data, nor does what had been tried by then."


def as_best_so_far(decision: Decision) -> Decision:
    """Return the decision of a search that was ended early: it does not say that nothing else explains the data."""
    reason, text = decision.reason, decision.text
    if reason is VerdictReason.UNIQUE:
        reason, text = VerdictReason.BEST_SO_FAR, VerdictReason.BEST_SO_FAR.value
    elif decision.verdict == "unmodelled":
        text = NOT_YET
    return replace(decision, reason=reason, text=f"{text} {ENDED_EARLY}")


def _drop_nonstationary_lines(decision: Decision, log: Observations) -> Decision:
    """Remove effects of a steady frequency that leave lines close to it: what acts there changes its amplitude."""
    candidate = decision.model.candidate
    if not has_lines(log, candidate.fit):
        return decision
    left_hz = np.array([line.hz for line in residual_lines(log, candidate.fit)])
    near_hz = 2 * SAME_LINE_CYCLES / log.duration_s  # an amplitude that changes widens both lines
    lines_hz = {n: each["frequency_hz"] for n, each in candidate.values.items() if EFFECTS[n].steady_frequency}
    unsteady = {name for name, hz in lines_hz.items() if (np.abs(left_hz - np.asarray(hz)) < near_hz).any()}
    named = tuple(name for name in decision.named if name not in unsteady)
    if named == decision.named:
        return decision
    text = VerdictReason.NONSTATIONARY_LINE.value.format(names=", ".join(sorted(unsteady)))
    verdict: Verdict = "named_with_remainder" if named else "unmodelled"
    reason = VerdictReason.NONSTATIONARY_LINE
    return replace(decision, verdict=verdict, reason=reason, text=text, named=named, leaves_remainder=True)


def _group_indistinguishable(
    decision: Decision, baseline: frozenset[str], linearise: Callable[[], Substitutes]
) -> Decision:
    """Replace named effects by their ambiguity groups, whatever the fits of the groups' members say.

    First those of the baseline: beside a wrong length, a clock's rate differs from it by nothing but a loss.
    """
    for name in sorted(decision.named, key=lambda each: each not in baseline):
        if EFFECTS[name].found_before_search:
            continue
        substitutes = linearise()
        members: list[tuple[str, ...]] = [(name,), *((other,) for other in substitutes.alike(name))]
        if decision.verdict not in PARTIAL:
            members += [pair for pair in substitutes.alike_pairs(name) if has_one_cause(pair)]
        if len(members) > 1:
            decision = _with_group(decision, name, members)
    return decision


def has_one_cause(pair: tuple[str, str]) -> bool:
    """Whether one cause can make both errors: one tape or drum measures all distances along the rope.

    All of them times s are the times of the swing times √s, as a clock makes them.
    """
    return all(EFFECTS[name].length_like for name in pair)


def _state_coincidences(decision: Decision, substitutes: Substitutes) -> Decision:
    """Say which pairs of effects would explain the data as well: two causes that happen to add up to one."""
    found = [
        f"{' with '.join(pair)} in place of {name}"
        for name in decision.named
        if not EFFECTS[name].found_before_search
        for pair in substitutes.alike_pairs(name)[:MAX_COINCIDENCES]
    ]
    if not found:
        return decision
    return replace(decision, text=f"{decision.text[:-1]}, but for a coincidence: {'; '.join(found)}.")


def _with_group(decision: Decision, name: str, members: list[tuple[str, ...]]) -> Decision:
    """Put a group in place of a named effect; the first group of an answer are its candidates."""
    group = tuple(dict.fromkeys(chain.from_iterable(members)))[:MAX_AMBIGUOUS]
    sets = tuple(each for each in members if set(each) <= set(group))
    named = tuple(each for each in decision.named if each != name)
    stays = decision.verdict == "unmodelled" or (decision.leaves_remainder and named)
    verdict: Verdict = decision.verdict if stays else "one_of"
    decision = replace(decision, verdict=verdict, named=named)
    if decision.candidates:
        return replace(decision, also_one_of=(*decision.also_one_of, group))
    if verdict == "one_of" and decision.reason is not VerdictReason.PARTLY:
        decision = replace(decision, reason=VerdictReason.INDISTINGUISHABLE, text=VerdictReason.INDISTINGUISHABLE.value)
    return replace(decision, candidates=group, sets=sets if any(len(each) > 1 for each in sets) else ())
