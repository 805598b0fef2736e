"""Events: where they are looked for, from where they are tried, and how their fits are gone on with."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Value
from gateway.twin.reconcile.changepoints.changepoint import Beginning, parting, parting_after
from gateway.twin.reconcile.changepoints.changepoint_scan import Window, find_windows, outside_events
from gateway.twin.reconcile.changepoints.pre_event_candidates import one_motion_with
from gateway.twin.reconcile.decision.ambiguity_groups import LIKE_ANOTHER_ROPE
from gateway.twin.reconcile.residual.residual_tests import OPEN, to_go_on_with
from gateway.twin.reconcile.search.candidate_fits import LEAST_EFFECT, Attempt, Attempts
from gateway.twin.reconcile.search.initial_guesses import STARTS, Situation, first_values
from gateway.twin.reconcile.search.score_test import possible

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
TRANSIENT = tuple(n for n, e in EFFECTS.items() if e.transient)
CHANGES_LENGTH = frozenset({"hoisting", "load_change"})
INSTANT = frozenset({"impact", "load_change"})
"""Tried first: they have starts only where the motions before and after are close to each other."""
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
class EventSearch(Attempts):
    """Attempts, and what is known of when something happened."""

    partings: dict[tuple[frozenset[str], bool], Window | None] = field(default_factory=dict)
    """As found beside a set, with the rope's length or without."""
    beginnings: dict[frozenset[str], list[Beginning]] = field(default_factory=dict)
    """As found beside a set."""

    def has_event(self, parent: Attempt) -> bool:
        """One motion before, another after, and nothing else is missing: no clock and no lost sample does that."""
        parted, count = self.parted(parent, length=True), self.setting.log.count
        if parted is not None and parted.left < (1 + EVENT_LEAVES) * count:
            return True
        beside = [self._parted_after(begun, length=True) for begun in self._begun(parent)[:1] if not _slow(begun)]
        return any(parted is not None and parted.left < (1 + OPEN) * count for parted in beside)

    def parted(self, parent: Attempt, *, length: bool) -> Window | None:
        """Where the motions before and after an event part beside these effects."""
        key = (parent.names, length)
        if key not in self.partings:
            self.partings[key] = parting(self.setting, parent.values, length=length)
        return self.partings[key]

    def _begun(self, parent: Attempt) -> list[Beginning]:
        """With what acts all the time beside these effects, as it shows before an event; best first."""
        if self.setting.wide or not self.best().open or self._parts_cleanly(parent):
            return []
        if parent.names not in self.beginnings:
            self.beginnings[parent.names] = one_motion_with(self.setting, parent.values, possible(self.setting))
        return self.beginnings[parent.names]

    def _parted_after(self, begun: Beginning, *, length: bool) -> Window | None:
        key = (frozenset(begun.values), length)
        if key not in self.partings:
            self.partings[key] = parting_after(self.setting, begun, length=length)
        return self.partings[key]

    def _parts_cleanly(self, base: Attempt) -> bool:
        """An event alone explains it."""
        count = self.setting.log.count
        both = (self.parted(base, length=length) for length in (False, True))
        return any(parted is not None and parted.left < (1 + OPEN) * count for parted in both)

    def _windows(self, parent: Attempt, *, length: bool) -> tuple[Window, ...]:
        setting, o = self.setting, self.setting.log
        extra = ("rope_length",) if length and "rope_length" not in parent.values else ()
        simulator = setting.simulator((*parent.values, *extra))
        model = setting.simulator(tuple(parent.values)).effects(parent.fit.values)
        at = simulator.values(parent.fit.values[: simulator.starts], model)
        found = simulator.linearise(at, o.time_s, o.temperature_c)
        weight = (o.used[:, None] / o.noise_g)[:, :, None]
        chosen = [0, 1, 2, 3] + [i for i, s in enumerate(simulator.parameters) if s.effect in extra]
        return find_windows(
            o.time_s, o.residual_sigma(parent.fit.force_g), (found.jacobian * weight)[..., chosen], o.used
        )

    def _try_windows(self, parent: Attempt, starts: Array, residual_g: Array, *, alone: bool) -> None:
        """Events where motions of their own before and after promise it; `alone`: beside nothing that was added."""
        setting, o = self.setting, self.setting.log
        for lengths in (False, True):
            windows, parted = self._windows(parent, length=lengths), self.parted(parent, length=lengths)
            situation = Situation(setting.rig, o, residual_g, windows, parted)
            best = self.best()
            # With the rope's length the answer is far from linear, and the windows' promise is too small.
            share = HOPEFUL if lengths and (parted or alone) else WINDOWS_LEAVE
            left = min(w.left for w in (*windows, *([] if parted is None else [parted])))
            if left - o.count < max(share * (best.fit.chi2 - o.count), OPEN * o.count):
                for name in TRANSIENT:
                    if (name in CHANGES_LENGTH) == lengths:
                        self._try(parent, name, STARTS[name](situation), starts)

    def _try_beside_beginnings(self, base: Attempt) -> None:
        """Events beside what acts all the time and shows before them; over the whole log the event hides it."""
        begun = self._begun(base)
        for first in begun[:PARENTS]:
            self._try_events_after(first)
            self._polished(len(first.values) + 1)
            if not self._more_is_missing(self.best()):
                break
        best = self.best()
        events = {name: each for name, each in best.values.items() if EFFECTS[name].transient}
        for other in begun if events else []:
            if frozenset({*other.values, *events}) not in self.attempts:
                self.try_values({**other.values, **events}, beyond=self._rival_chi2())

    def _try_events_after(self, begun: Beginning) -> None:
        """What the motion after it says of the rope tells what may have happened."""
        setting, o = self.setting, self.setting.log
        starts = setting.starts(begun.values)
        enough = (1 + EVENT_LEAVES) * o.count
        for length in (False, True):
            parted = self._parted_after(begun, length=length)
            if parted is None or parted.left > enough:
                continue
            enough = parted.left - LEAST_EFFECT * o.count  # a rope that makes no difference did not change
            situation = Situation(setting.rig, o, o.force_g - begun.fit.force_g, (), parted)
            for name in sorted(TRANSIENT, key=lambda name: name not in INSTANT):
                if (name in CHANGES_LENGTH) == length:
                    self._try_starts(begun.values, name, STARTS[name](situation), starts)

    def _try(self, parent: Attempt, name: str, starts_of: Iterable[Mapping[str, Value]], starts: Array | None) -> None:
        if name in parent.values or name in self.setting.believed or _excluded(name, parent.names):
            return
        tried = list(starts_of)
        if name == "double_pendulum" and tried:
            several = [{**parent.values, name: values} for values in tried]
            tried = [self.setting.best_rigging(several)[name]]
        self._try_starts(parent.values, name, tried, starts)

    def _try_starts(
        self, others: Values, name: str, tried: Iterable[Mapping[str, Value]], starts: Array | None
    ) -> None:
        """One after another until nothing is left."""
        for turn, values in enumerate(tried):
            if turn and (self.tired or not self.best().open):
                return
            self.try_values({**others, name: values or first_values(name)}, starts, beyond=self._rival_chi2())

    def _rival_chi2(self) -> float:
        """Above this a set is no rival to the best; twice what is left, since fits still creep."""
        best = self.best()
        return 2 * best.fit.chi2

    def _more_is_missing(self, attempt: Attempt) -> bool:
        """Something is left, and not only while an event went on that has a course of its own."""
        return attempt.open and to_go_on_with(outside_events(self.setting.log, attempt.values), attempt.fit)

    def _polished(self, size: int) -> None:
        """Go on with the best fits of what creeps along narrow valleys."""
        unit = self.unit()
        ranked = sorted((a for a in self.attempts.values() if len(a.values) == size), key=lambda a: self.bic(a, unit))
        for attempt in ranked[:POLISHED]:
            if self.best().open and _creeps(attempt):
                polished = self.try_values(attempt.values, rounds=POLISH_ROUNDS)
                if polished is not None:
                    for name in sorted(polished.names):
                        self._stretched(polished, name)

    def _stretched(self, attempt: Attempt, name: str) -> None:
        """Once more with an event shorter and longer about the same middle, and with other edges.

        A short strong one is much like a long weak one; from sharp edges no small step leads to slow ones.
        """
        for changed in _stretches(name, attempt.values[name]):
            if self._more_is_missing(self.best()):
                self.try_values({**attempt.values, name: changed}, rounds=POLISH_ROUNDS, beyond=self._rival_chi2())


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


def _slow(begun: Beginning) -> bool:
    """With what a slow clock is like: lost samples make an end of another rope."""
    return bool(LIKE_ANOTHER_ROPE & set(begun.values))


def _creeps(attempt: Attempt) -> bool:
    """An event's fit, and that of a double pendulum near its end, where rigging and hook make up for each other."""
    if any(EFFECTS[name].transient for name in attempt.values):
        return True
    return "double_pendulum" in attempt.values and attempt.reduced < NEARLY


def _excluded(name: str, names: frozenset[str]) -> bool:
    return {name} | names >= {"double_pendulum", "rope_stretch"}
