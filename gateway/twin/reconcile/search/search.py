"""The search for what is missing: singles, pairs, swaps and drops."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.decision.ambiguity_groups import ambiguity_partners
from gateway.twin.reconcile.search.candidate_fits import CandidateFit
from gateway.twin.reconcile.search.event_search import NEARLY, PARENTS, POLISH_ROUNDS, EventSearch
from gateway.twin.reconcile.search.score_test import (
    Signatures,
    compute_signatures,
    scorable_effects,
)

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
STRUCTURAL = 0.5
"""What a second mode or a bounce may leave of the gap for other lines to be looked for in what it leaves."""
MOST_EFFECTS = 3
FAR_BEHIND = 100.0
"""Times as much as the best of a size leaves: what leaves more than that lacks what the best has."""
CHILDREN = 4
HOPELESS = 0.5
"""An effect whose signature reaches less than this share of what the best one's reaches is no rival to one that explains all."""
TAKES_MOST = 0.5
"""What the best lasting effect may leave of the gap for pairs of it to be tried before events."""
LEAST_SHARE = 0.8
"""What the best single effect may leave of the gap for pairs to be looked at: one of two causes does more than that alone."""
WORTH_GOING_ON = 0.1
"""What pairs leave of the gap, beyond which more effects only bend the model to the data."""
BENDS = 0.5
"""What a third effect may leave of what two leave: one that leaves more bends the model to a remainder."""


@dataclass(frozen=True, slots=True)
class Move:
    """A step of the search that was kept."""

    added: frozenset[str]
    dropped: frozenset[str]
    names: frozenset[str]
    reduced: float
    bic: float


@dataclass(slots=True)
class Search(EventSearch):
    """Attempts, and what led from one to the next."""

    scores: dict[str, float] = field(default_factory=dict)
    """Drop of chi-square beside the nuisances alone, by linearisation."""
    signatures: Signatures | None = None
    """Beside what is always there."""
    history: list[Move] = field(default_factory=list)

    def fit_persistent_effects(self, base: CandidateFit) -> CandidateFit:
        """The best of the base and all single effects beside it that act all the time."""
        self._lasting_children(base, self.setting.segment_starts(base.values), first=True)
        return self.best()

    def fit_single_effects(self, base: CandidateFit) -> CandidateFit:
        """The best of the base and all single effects; `lasting` comes first."""
        self._pairs_of_lasting(base)
        starts = self.setting.segment_starts(base.values)
        self._fit_with_prefix_effects(base)
        self._try_found_in_data(base, starts)
        self._refine_best(len(base.values) + 1)
        self._fit_ambiguity_partners(base, starts)
        best = self._to_go_on_from(base)
        return self._record_move(base, best if self.is_significant(base, best) else base)

    def _to_go_on_from(self, base: CandidateFit) -> CandidateFit:
        """The best; not a pair of lasting effects that leaves something: events beside either have not been tried then."""
        best, size = self.best(), len(base.values) + 1
        if (
            len(best.values) <= size
            or not set(best.values) <= set(EFFECTS.choose(is_scored=True)) | set(base.values)
            or not best.has_unexplained_residual
        ):
            return best
        unit = self.noise_inflation()
        return min((a for a in self.candidates.values() if len(a.values) <= size), key=lambda a: self.bic(a, unit))

    def add_second_mode(self, base: CandidateFit) -> CandidateFit:
        """A second mode or a bounce beside the base, where that is most of what is left; else the base."""
        if self.setting.large_amplitude:
            return base
        for name in _structural_effects():
            self._try_spectral(base, name, self.setting.log.force_g - base.fit.force_g)
        tried = [
            self.candidates[names]
            for name in _structural_effects()
            if (names := base.names | {name}) in self.candidates
        ]
        best = min([base, *tried], key=lambda a: a.reduced_chi2)
        return best if best.reduced_chi2 - 1 < STRUCTURAL * (base.reduced_chi2 - 1) else base

    def run(self, base: CandidateFit, best: CandidateFit) -> CandidateFit:
        """On from the best single effect, until nothing worth a name is left."""
        if best.reduced_chi2 - 1 > LEAST_SHARE * (base.reduced_chi2 - 1):
            return self._record_move(best, self._backward_elimination(best))
        for _ in range(MOST_EFFECTS - 1):
            if not self._more_is_missing(best) or self.is_budget_exhausted:
                break
            ahead = self._forward_step(self._parents(len(best.values)))
            if ahead is best:
                break
            if len(best.values) > len(self.baseline_effects) + 1 and ahead.reduced_chi2 - 1 > BENDS * (
                best.reduced_chi2 - 1
            ):
                break
            hopeless = ahead.reduced_chi2 - 1 > WORTH_GOING_ON * (base.reduced_chi2 - 1)
            if hopeless:
                best = self._record_move(best, ahead)
                break
            best = self._record_move(best, self._try_swaps(ahead))
        best = self._refine_double_pendulum(best)
        return self._record_move(best, self._backward_elimination(best))

    def _refine_double_pendulum(self, best: CandidateFit) -> CandidateFit:
        """A double pendulum's fit creeps on below what the log asks for; another swing asks for more of it."""
        if not any(EFFECTS[name].slow_convergence for name in best.names) or best.reduced_chi2 > NEARLY:
            return best
        return self.fit_candidate(best.values, rounds=POLISH_ROUNDS) or best

    def _record_move(self, before: CandidateFit, after: CandidateFit) -> CandidateFit:
        if before.names != after.names:
            move = Move(
                after.names - before.names,
                before.names - after.names,
                after.names,
                after.reduced_chi2,
                self.bic(after, self.noise_inflation()),
            )
            self.history.append(move)
        return after

    def _fit_ambiguity_partners(self, parent: CandidateFit, starts: Array) -> None:
        """Whatever is hard to tell from the best is fitted, too, however little a linear look promised of it."""
        best = self.best()
        for name in sorted(ambiguity_partners(best.names - parent.names) & set(scorable_effects(self.setting))):
            if frozenset({*parent.names, name}) not in self.candidates:
                self._try_lasting(parent, name, starts)

    def _pairs_of_lasting(self, base: CandidateFit) -> None:
        """Where the best single effect takes most of the gap: others beside it, which are quicker to try than events."""
        best = self.best()
        if (
            not best.has_unexplained_residual
            or best.reduced_chi2 - 1 > TAKES_MOST * (base.reduced_chi2 - 1)
            or self.setting.large_amplitude
        ):
            return
        for parent in self._parents(len(base.values) + 1):
            self._lasting_children(parent, self.setting.segment_starts(parent.values), first=False)
        pair = self.best()
        if not pair.has_unexplained_residual and len(pair.values) > len(best.values):
            self._try_swaps(pair)

    def _try_lasting(self, parent: CandidateFit, name: str, starts: Array) -> None:
        setting = self.setting
        turns = EFFECTS[name].guesses_from_data  # pieces cannot be told to join before it is known how fast they turn
        situation = setting.guess_context(setting.log.force_g - parent.fit.force_g)
        self._try(parent, name, EFFECTS[name].initial_guesses(situation) if turns else [{}], None if turns else starts)

    def _parents(self, size: int) -> list[CandidateFit]:
        unit = self.noise_inflation()
        ranked = sorted((a for a in self.candidates.values() if len(a.values) == size), key=lambda a: self.bic(a, unit))
        most = PARENTS if size == len(self.baseline_effects) + 1 else 1
        return [a for a in ranked[:most] if a.fit.chi2 < FAR_BEHIND * ranked[0].fit.chi2]

    def _forward_step(self, parents: list[CandidateFit]) -> CandidateFit:
        """All that one more effect can do beside each parent; the best of all afterwards."""
        before = self.best()
        for parent in parents:
            if self.is_budget_exhausted:
                break
            starts = self.setting.segment_starts(parent.values)
            self._lasting_children(parent, starts, first=False)
            self._try_found_in_data(parent, starts)
        self._refine_best(len(parents[0].values) + 1)
        after = self.best()
        return after if self.is_significant(before, after) else before

    def _lasting_children(self, parent: CandidateFit, starts: Array, *, first: bool) -> None:
        setting = self.setting
        scored = compute_signatures(setting, parent.fit, parent.values, scorable_effects(setting))
        drops = {name: scored.predicted_chi2_drop(name) for name in scored.of}
        if first:
            self.scores.update(drops)
            self.signatures = scored
        ranked = sorted(drops, key=lambda name: -drops[name])
        for rank, name in enumerate(ranked):
            explained = not self.best().has_unexplained_residual
            if drops[name] < HOPELESS * drops[ranked[0]] and (explained or rank >= CHILDREN):
                break
            if not first and rank >= CHILDREN:
                break
            if parent.names | {name} not in self.candidates:
                self._try_lasting(parent, name, starts)

    def _try_found_in_data(self, parent: CandidateFit, starts: Array) -> None:
        """Effects whose times or frequencies have to be found first: in what a model that follows the motion leaves.

        A wide swing is followed only by a model with the right losses; before that, nothing is to be found there.
        """
        setting, o = self.setting, self.setting.log
        if setting.large_amplitude:
            return
        residual_g = o.force_g - parent.fit.force_g
        for name in EFFECTS.choose(is_guessed_from_residual=True):
            if self.best().has_unexplained_residual and parent.names | {name} not in self.candidates:
                self._try_spectral(parent, name, residual_g)
        best = self.best()
        if not best.has_unexplained_residual and best is not parent:
            return
        self._try_windows(parent, starts, residual_g, alone=len(parent.values) == len(self.baseline_effects))

    def _try_spectral(self, parent: CandidateFit, name: str, residual_g: Array) -> None:
        situation = self.setting.guess_context(residual_g)
        self._try(parent, name, EFFECTS[name].initial_guesses(situation), None)

    def _try_swaps(self, best: CandidateFit) -> CandidateFit:
        """Each effect of a pair is replaced by the best others, the rest kept."""
        for name in sorted(best.names - set(self.baseline_effects)):
            if self.is_budget_exhausted:
                break
            rest = {n: v for n, v in best.values.items() if n != name}
            without = self.candidates.get(frozenset(rest)) or self.fit_candidate(rest)
            decided = (
                without is not None
                and EFFECTS[name].structure is not ModelStructure.ROPE
                and without.fit.chi2 > FAR_BEHIND * best.fit.chi2
            )
            if without is not None and not decided:
                starts = self.setting.segment_starts(without.values)
                scored = compute_signatures(self.setting, without.fit, without.values, scorable_effects(self.setting))
                likely = sorted(scored.of, key=lambda n: -scored.predicted_chi2_drop(n))[:CHILDREN]
                for other in sorted({*likely, *(ambiguity_partners(frozenset({name})) & set(scored.of))}):
                    if frozenset({*rest, other}) not in self.candidates:
                        self._try_lasting(without, other, starts)
        found = self.best()
        return found if self.is_significant(best, found) or len(found.values) <= len(best.values) else best

    def _backward_elimination(self, best: CandidateFit) -> CandidateFit:
        """Without what is not worth its name."""
        for name in sorted(name for name in best.names if not EFFECTS[name].detected_in_samples):
            rest = {n: v for n, v in best.values.items() if n != name}
            without = self.fit_candidate(
                rest, rounds=POLISH_ROUNDS, beyond=np.inf if best.has_unexplained_residual else self._rival_chi2()
            )
            if without is not None and not self.is_significant(without, best):
                return self._backward_elimination(without)
        return best


def _structural_effects() -> tuple[str, ...]:
    """Effects that add a mode to the motion."""
    return tuple(name for name, effect in EFFECTS.items() if effect.structure is not ModelStructure.ROPE)
