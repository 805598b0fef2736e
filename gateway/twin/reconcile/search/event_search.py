"""Events: where they are looked for, from where they are tried, and how their fits are gone on with."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.rope import DoublePendulum, RopeLength
from gateway.twin.reconcile.changepoints.changepoint import (
    ConsistentPrefix,
    locate_changepoint,
    locate_next_changepoint,
)
from gateway.twin.reconcile.changepoints.changepoint_scan import (
    exclude_unmodelled_profiles,
    scan_for_changepoints,
)
from gateway.twin.reconcile.changepoints.pre_event_candidates import effects_extending_consistent_prefix
from gateway.twin.reconcile.residual.residual_tests import EXCESS_SIGNIFICANT, warrants_another_effect
from gateway.twin.reconcile.search.candidate_fits import MIN_VARIANCE_SHARE, CandidateFit, CandidateTable
from gateway.twin.reconcile.search.score_test import scorable_effects

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
PARENTS = 2
HOPEFUL, WINDOWS_LEAVE = 1.3, 0.6
"""An event is tried where its window leaves less than this part of what the best model so far leaves."""
EVENT_LEAVES = 0.2
NEARLY = 2.0
"""Reduced chi-square below which a double pendulum's fit is gone on with: before, what else is missing decides where it ends."""
POLISHED, POLISH_ROUNDS = 2, 20
STRETCHED = (2.5, 0.4)
EDGES = (0.1, 0.5)


@dataclass(slots=True)
class EventSearch(CandidateTable):
    """Attempts, and what is known of when something happened."""

    partings: dict[tuple[frozenset[str], bool], EventWindow | None] = field(default_factory=dict)
    """As found beside a set, with the rope's length or without."""
    beginnings: dict[frozenset[str], list[ConsistentPrefix]] = field(default_factory=dict)
    """As found beside a set."""

    def has_event(self, parent: CandidateFit) -> bool:
        """One motion before, another after, and nothing else is missing: no clock and no lost sample does that."""
        parted, count = self.segmentation(parent, length=True), self.setting.log.n_values
        if parted is not None and parted.remaining_chi2 < (1 + EVENT_LEAVES) * count:
            return True
        beside = [
            self._next_segmentation(begun, length=True) for begun in self._prefix_fit(parent)[:1] if not _slow(begun)
        ]
        return any(parted is not None and parted.remaining_chi2 < (1 + EXCESS_SIGNIFICANT) * count for parted in beside)

    def segmentation(self, parent: CandidateFit, *, length: bool) -> EventWindow | None:
        """Where the motions before and after an event part beside these effects."""
        key = (parent.names, length)
        if key not in self.partings:
            self.partings[key] = locate_changepoint(self.setting, parent.values, length=length)
        return self.partings[key]

    def _prefix_fit(self, parent: CandidateFit) -> list[ConsistentPrefix]:
        """With what acts all the time beside these effects, as it shows before an event; best first."""
        if (
            self.setting.large_amplitude
            or not self.best().has_unexplained_residual
            or self._event_alone_suffices(parent)
        ):
            return []
        if parent.names not in self.beginnings:
            self.beginnings[parent.names] = effects_extending_consistent_prefix(
                self.setting, parent.values, scorable_effects(self.setting)
            )
        return self.beginnings[parent.names]

    def _next_segmentation(self, begun: ConsistentPrefix, *, length: bool) -> EventWindow | None:
        key = (frozenset(begun.values), length)
        if key not in self.partings:
            self.partings[key] = locate_next_changepoint(self.setting, begun, length=length)
        return self.partings[key]

    def _event_alone_suffices(self, base: CandidateFit) -> bool:
        """An event alone explains it."""
        count = self.setting.log.n_values
        both = (self.segmentation(base, length=length) for length in (False, True))
        return any(parted is not None and parted.remaining_chi2 < (1 + EXCESS_SIGNIFICANT) * count for parted in both)

    def _windows(self, parent: CandidateFit, *, length: bool) -> tuple[EventWindow, ...]:
        setting, o = self.setting, self.setting.log
        extra = (RopeLength.name,) if length and RopeLength.name not in parent.values else ()
        simulator = setting.simulator((*parent.values, *extra))
        model = setting.simulator(tuple(parent.values)).effects(parent.fit.values)
        at = simulator.values(parent.fit.values[: simulator.n_initial_states], model)
        found = simulator.linearise(at, o.time_s, o.temperature_c)
        weight = (o.used[:, None] / o.noise_g)[:, :, None]
        chosen = [0, 1, 2, 3] + [i for i, s in enumerate(simulator.parameters) if s.effect in extra]
        return scan_for_changepoints(
            o.time_s, o.residual_sigma(parent.fit.force_g), (found.jacobian * weight)[..., chosen], o.used
        )

    def _try_windows(self, parent: CandidateFit, starts: Array, residual_g: Array, *, alone: bool) -> None:
        """Events where motions of their own before and after promise it; `alone`: beside nothing that was added."""
        setting, o = self.setting, self.setting.log
        for lengths in (False, True):
            windows, parted = self._windows(parent, length=lengths), self.segmentation(parent, length=lengths)
            situation = setting.guess_context(residual_g, windows, parted)
            best = self.best()
            # With the rope's length the answer is far from linear, and the windows' promise is too small.
            share = HOPEFUL if lengths and (parted or alone) else WINDOWS_LEAVE
            left = min(w.remaining_chi2 for w in (*windows, *([] if parted is None else [parted])))
            if left - o.n_values < max(share * (best.fit.chi2 - o.n_values), EXCESS_SIGNIFICANT * o.n_values):
                for name in EFFECTS.choose(transient=True):
                    if EFFECTS[name].changes_length == lengths:
                        self._try(parent, name, EFFECTS[name].initial_guesses(situation), starts)

    def _fit_with_prefix_effects(self, base: CandidateFit) -> None:
        """Events beside what acts all the time and shows before them; over the whole log the event hides it."""
        begun = self._prefix_fit(base)
        for first in begun[:PARENTS]:
            self._try_events_after(first)
            self._refine_best(len(first.values) + 1)
            if not self._more_is_missing(self.best()):
                break
        best = self.best()
        events = {name: each for name, each in best.values.items() if EFFECTS[name].transient}
        for other in begun if events else []:
            if frozenset({*other.values, *events}) not in self.candidates:
                self.fit_candidate({**other.values, **events}, beyond=self._rival_chi2())

    def _try_events_after(self, begun: ConsistentPrefix) -> None:
        """What the motion after it says of the rope tells what may have happened."""
        setting, o = self.setting, self.setting.log
        starts = setting.segment_starts(begun.values)
        enough = (1 + EVENT_LEAVES) * o.n_values
        for length in (False, True):
            parted = self._next_segmentation(begun, length=length)
            if parted is None or parted.remaining_chi2 > enough:
                continue
            enough = (
                parted.remaining_chi2 - MIN_VARIANCE_SHARE * o.n_values
            )  # a rope that makes no difference did not change
            situation = setting.guess_context(o.force_g - begun.fit.force_g, (), parted)
            for name in sorted(EFFECTS.choose(transient=True), key=lambda name: not EFFECTS[name].instantaneous):
                if EFFECTS[name].changes_length == length:
                    self._try_starts(begun.values, name, EFFECTS[name].initial_guesses(situation), starts)

    def _try(
        self, parent: CandidateFit, name: str, starts_of: Iterable[Mapping[str, Value]], starts: Array | None
    ) -> None:
        if name in parent.values or name in self.setting.model_effects or _excluded(name, parent.names):
            return
        tried = list(starts_of)
        if name == DoublePendulum.name and tried:
            several = [{**parent.values, name: values} for values in tried]
            tried = [self.setting.fit_rigging_length(several)[name]]
        self._try_starts(parent.values, name, tried, starts)

    def _try_starts(
        self, others: Values, name: str, tried: Iterable[Mapping[str, Value]], starts: Array | None
    ) -> None:
        """One after another until nothing is left."""
        for turn, values in enumerate(tried):
            if turn and (self.is_budget_exhausted or not self.best().has_unexplained_residual):
                return
            self.fit_candidate(
                {**others, name: values or EFFECTS[name].default_guess}, starts, beyond=self._rival_chi2()
            )

    def _rival_chi2(self) -> float:
        """Above this a set is no rival to the best; twice what is left, since fits still creep."""
        best = self.best()
        return 2 * best.fit.chi2

    def _more_is_missing(self, attempt: CandidateFit) -> bool:
        """Something is left, and not only while an event went on that has a course of its own."""
        return attempt.has_unexplained_residual and warrants_another_effect(
            exclude_unmodelled_profiles(self.setting.log, attempt.values), attempt.fit
        )

    def _refine_best(self, size: int) -> None:
        """Go on with the best fits of what creeps along narrow valleys."""
        unit = self.noise_inflation()
        ranked = sorted((a for a in self.candidates.values() if len(a.values) == size), key=lambda a: self.bic(a, unit))
        for attempt in ranked[:POLISHED]:
            if self.best().has_unexplained_residual and _converges_slowly(attempt):
                polished = self.fit_candidate(attempt.values, rounds=POLISH_ROUNDS)
                if polished is not None:
                    for name in sorted(polished.names):
                        self._refine_event_edges(polished, name)

    def _refine_event_edges(self, attempt: CandidateFit, name: str) -> None:
        """Once more with an event shorter and longer about the same middle, and with other edges.

        A short strong one is much like a long weak one; from sharp edges no small step leads to slow ones.
        """
        for changed in _stretches(name, attempt.values[name]):
            if self._more_is_missing(self.best()):
                self.fit_candidate({**attempt.values, name: changed}, rounds=POLISH_ROUNDS, beyond=self._rival_chi2())


def _stretches(name: str, values: Mapping[str, Value]) -> Iterable[Mapping[str, Value]]:
    if not EFFECTS[name].transient:
        return
    if "duration_s" in values and "coast_s" not in values:
        start_s, duration_s = (float(np.asarray(values[key])) for key in ("start_s", "duration_s"))
        for factor in STRETCHED:
            length_s = factor * duration_s
            yield {**values, "start_s": start_s + (duration_s - length_s) / 2, "duration_s": length_s}
    if "rising_share" in values:
        for share in EDGES:
            yield {**values, "rising_share": share}


def _slow(begun: ConsistentPrefix) -> bool:
    """With what a slow clock is like: lost samples make an end of another rope."""
    return any(EFFECTS[name].scales_period or EFFECTS[name].length_like for name in begun.values)


def _converges_slowly(attempt: CandidateFit) -> bool:
    """An event's fit, and that of a double pendulum near its end, where rigging and hook make up for each other."""
    if any(EFFECTS[name].transient for name in attempt.values):
        return True
    return any(EFFECTS[name].slow_convergence for name in attempt.values) and attempt.reduced_chi2 < NEARLY


def _excluded(name: str, names: frozenset[str]) -> bool:
    structures = {EFFECTS[each].structure for each in (name, *names)} - {ModelStructure.ROPE}
    return len(structures) > 1
