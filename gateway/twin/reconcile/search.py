"""The search for what is missing: singles, pairs, swaps and drops."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Value
from gateway.twin.reconcile.attempts import LEAST_EFFECT, Attempt, Attempts
from gateway.twin.reconcile.beginnings import one_motion_with
from gateway.twin.reconcile.events import Window, find_windows, outside_events
from gateway.twin.reconcile.groups import mates_of
from gateway.twin.reconcile.partings import LIKE_ANOTHER_ROPE, Beginning, parting, parting_after
from gateway.twin.reconcile.remainder import OPEN, to_go_on_with
from gateway.twin.reconcile.score import UNSUITED, Signatures, signatures
from gateway.twin.reconcile.setting import Setting
from gateway.twin.reconcile.starting import STARTS, Situation, first_values

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
LASTING = tuple(n for n, e in EFFECTS.items() if not e.transient and n not in UNSUITED)
TRANSIENT = tuple(n for n, e in EFFECTS.items() if e.transient)
STRUCTURES = ("rope_stretch", "double_pendulum")
SPECTRAL = ("clipping", *STRUCTURES)
STRUCTURAL = 0.5
"""What a second mode or a bounce may leave of the gap for other lines to be looked for in what it leaves."""
NEARLY = 2.0
"""Reduced chi-square below which a double pendulum's fit is gone on with: before, what else is missing decides where it ends."""
TURNING = frozenset({"housing_spin", "slewing"})
"""Pieces cannot be told to join before it is known how fast they turn."""
CHANGES_LENGTH = frozenset({"hoisting", "load_change"})
INSTANT = frozenset({"impact", "load_change"})
"""Tried first: they have starts only where the motions before and after are close to each other."""
SEEN = frozenset({"quantization", "clipping"})
"""Found in the readings themselves: no fit takes them away again."""
MOST_EFFECTS = 3
PARENTS = 2
FAR_BEHIND = 100.0
"""Times as much as the best of a size leaves: what leaves more than that lacks what the best has."""
CHILDREN = 4
HOPELESS = 0.5
"""An effect whose signature reaches less than this share of what the best one's reaches is no rival to one that explains all."""
HOPEFUL, WINDOWS_LEAVE = 1.3, 0.6
"""An event is tried where its window leaves less than this part of what the best model so far leaves."""
EVENT_LEAVES = 0.2
TAKES_MOST = 0.5
"""What the best lasting effect may leave of the gap for pairs of it to be tried before events."""
LEAST_SHARE = 0.8
"""What the best single effect may leave of the gap for pairs to be looked at: one of two causes does more than that alone."""
WORTH_GOING_ON = 0.1
"""What pairs leave of the gap, beyond which more effects only bend the model to the data."""
BENDS = 0.5
"""What a third effect may leave of what two leave: one that leaves more bends the model to a remainder."""
POLISHED, POLISH_ROUNDS = 2, 20
STRETCHED = (2.5, 0.4)
EDGES = (0.1, 0.5)


@dataclass(frozen=True, slots=True)
class Move:
    """A step of the search that was kept."""

    added: frozenset[str]
    dropped: frozenset[str]
    names: frozenset[str]
    reduced: float
    bic: float


@dataclass(slots=True)
class Search(Attempts):
    """Attempts, and what led from one to the next."""

    scores: dict[str, float] = field(default_factory=dict)
    """Drop of chi-square beside the nuisances alone, by linearisation."""
    signatures: Signatures | None = None
    """Beside what is always there."""
    history: list[Move] = field(default_factory=list)
    partings: dict[tuple[frozenset[str], bool], Window | None] = field(default_factory=dict)
    """As found beside a set, with the rope's length or without."""
    beginnings: dict[frozenset[str], list[Beginning]] = field(default_factory=dict)
    """As found beside a set."""

    def lasting(self, base: Attempt) -> Attempt:
        """The best of the base and all single effects beside it that act all the time."""
        self._lasting_children(base, self.setting.starts(base.values), first=True)
        return self.best()

    def singles(self, base: Attempt) -> Attempt:
        """The best of the base and all single effects; `lasting` comes first."""
        self._pairs_of_lasting(base)
        starts = self.setting.starts(base.values)
        self._try_beside_beginnings(base)
        self._try_found_in_data(base, starts)
        self._polished(len(base.values) + 1)
        self._mates(base, starts)
        best = self.best()
        return self._kept(base, best if self.worth(base, best) else base)

    def structure(self, base: Attempt) -> Attempt:
        """A second mode or a bounce beside the base, where that is most of what is left; else the base."""
        if self.setting.wide:
            return base
        for name in STRUCTURES:
            self._try_spectral(base, name, self.setting.log.force_g - base.fit.force_g)
        tried = [self.attempts[names] for name in STRUCTURES if (names := base.names | {name}) in self.attempts]
        best = min([base, *tried], key=lambda a: a.reduced)
        return best if best.reduced - 1 < STRUCTURAL * (base.reduced - 1) else base

    def run(self, base: Attempt, best: Attempt) -> Attempt:
        """On from the best single effect, until nothing worth a name is left."""
        if best.reduced - 1 > LEAST_SHARE * (base.reduced - 1):
            return self._kept(best, self._dropped(best))
        for _ in range(MOST_EFFECTS - 1):
            if not self._more_is_missing(best) or self.tired:
                break
            ahead = self._grow(self._parents(len(best.values)))
            if ahead is best:
                break
            if len(best.values) > len(self.always) + 1 and ahead.reduced - 1 > BENDS * (best.reduced - 1):
                break
            hopeless = ahead.reduced - 1 > WORTH_GOING_ON * (base.reduced - 1)
            if hopeless:
                best = self._kept(best, ahead)
                break
            best = self._kept(best, self._swapped(ahead))
        best = self._settled(best)
        return self._kept(best, self._dropped(best))

    def _settled(self, best: Attempt) -> Attempt:
        """A double pendulum's fit creeps on below what the log asks for; another swing asks for more of it."""
        if "double_pendulum" not in best.names or best.reduced > NEARLY:
            return best
        return self.try_values(best.values, rounds=POLISH_ROUNDS) or best

    def _kept(self, before: Attempt, after: Attempt) -> Attempt:
        if before.names != after.names:
            move = Move(
                after.names - before.names,
                before.names - after.names,
                after.names,
                after.reduced,
                self.bic(after, self.unit()),
            )
            self.history.append(move)
        return after

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

    def _mates(self, parent: Attempt, starts: Array) -> None:
        """Whatever is hard to tell from the best is fitted, too, however little a linear look promised of it."""
        best = self.best()
        for name in sorted(mates_of(best.names - parent.names) & set(possible(self.setting))):
            if frozenset({*parent.names, name}) not in self.attempts:
                self._try_lasting(parent, name, starts)

    def _pairs_of_lasting(self, base: Attempt) -> None:
        """Where the best single effect takes most of the gap: others beside it, which are quicker to try than events."""
        best = self.best()
        if best.open and best.reduced - 1 < TAKES_MOST * (base.reduced - 1) and not self.setting.wide:
            self._lasting_children(best, self.setting.starts(best.values), first=False)
            pair = self.best()
            if not pair.open and len(pair.values) > len(best.values):
                self._swapped(pair)

    def _try_lasting(self, parent: Attempt, name: str, starts: Array) -> None:
        setting = self.setting
        turns = name in TURNING
        situation = Situation(setting.rig, setting.log, setting.log.force_g - parent.fit.force_g, ())
        self._try(parent, name, STARTS[name](situation) if turns else [{}], None if turns else starts)

    def _stretched(self, attempt: Attempt, name: str) -> None:
        """Once more with an event shorter and longer about the same middle, and with other edges.

        A short strong one is much like a long weak one; from sharp edges no small step leads to slow ones.
        """
        for changed in _stretches(name, attempt.values[name]):
            if self._more_is_missing(self.best()):
                self.try_values({**attempt.values, name: changed}, rounds=POLISH_ROUNDS, beyond=self._rival_chi2())

    def _rival_chi2(self) -> float:
        """Above this a set is no rival to the best; twice what is left, since fits still creep."""
        best = self.best()
        return 2 * best.fit.chi2

    def _parents(self, size: int) -> list[Attempt]:
        unit = self.unit()
        ranked = sorted((a for a in self.attempts.values() if len(a.values) == size), key=lambda a: self.bic(a, unit))
        most = PARENTS if size == len(self.always) + 1 else 1
        return [a for a in ranked[:most] if a.fit.chi2 < FAR_BEHIND * ranked[0].fit.chi2]

    def _grow(self, parents: list[Attempt]) -> Attempt:
        """All that one more effect can do beside each parent; the best of all afterwards."""
        before = self.best()
        for parent in parents:
            if self.tired:
                break
            starts = self.setting.starts(parent.values)
            self._lasting_children(parent, starts, first=False)
            self._try_found_in_data(parent, starts)
        self._polished(len(parents[0].values) + 1)
        after = self.best()
        return after if self.worth(before, after) else before

    def _lasting_children(self, parent: Attempt, starts: Array, *, first: bool) -> None:
        setting = self.setting
        scored = signatures(setting, parent.fit, parent.values, possible(setting))
        drops = {name: scored.drop(name) for name in scored.of}
        if first:
            self.scores.update(drops)
            self.signatures = scored
        ranked = sorted(drops, key=lambda name: -drops[name])
        for rank, name in enumerate(ranked):
            explained = not self.best().open
            if drops[name] < HOPELESS * drops[ranked[0]] and (explained or rank >= CHILDREN):
                break
            if not first and rank >= CHILDREN:
                break
            self._try_lasting(parent, name, starts)

    def _try_found_in_data(self, parent: Attempt, starts: Array) -> None:
        """Effects whose times or frequencies have to be found first: in what a model that follows the motion leaves.

        A wide swing is followed only by a model with the right losses; before that, nothing is to be found there.
        """
        setting, o = self.setting, self.setting.log
        if setting.wide:
            return
        residual_g = o.force_g - parent.fit.force_g
        for name in SPECTRAL:
            if self.best().open and parent.names | {name} not in self.attempts:
                self._try_spectral(parent, name, residual_g)
        best = self.best()
        if not best.open and best is not parent:
            return
        for lengths in (False, True):
            windows, parted = self._windows(parent, length=lengths), self.parted(parent, length=lengths)
            situation = Situation(setting.rig, o, residual_g, windows, parted)
            best = self.best()
            # With the rope's length the answer is far from linear, and the windows' promise is too small.
            share = HOPEFUL if lengths and (parted or len(parent.values) == len(self.always)) else WINDOWS_LEAVE
            left = min(w.left for w in (*windows, *([] if parted is None else [parted])))
            if left - o.count < max(share * (best.fit.chi2 - o.count), OPEN * o.count):
                for name in TRANSIENT:
                    if (name in CHANGES_LENGTH) == lengths:
                        self._try(parent, name, STARTS[name](situation), starts)

    def _try_spectral(self, parent: Attempt, name: str, residual_g: Array) -> None:
        situation = Situation(self.setting.rig, self.setting.log, residual_g, ())
        self._try(parent, name, STARTS[name](situation), None)

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

    def _parts_cleanly(self, base: Attempt) -> bool:
        """An event alone explains it."""
        count = self.setting.log.count
        both = (self.parted(base, length=length) for length in (False, True))
        return any(parted is not None and parted.left < (1 + OPEN) * count for parted in both)

    def parted(self, parent: Attempt, *, length: bool) -> Window | None:
        """Where the motions before and after an event part beside these effects."""
        key = (parent.names, length)
        if key not in self.partings:
            self.partings[key] = parting(self.setting, parent.values, length=length)
        return self.partings[key]

    def has_event(self, parent: Attempt) -> bool:
        """One motion before, another after, and nothing else is missing: no clock and no lost sample does that."""
        parted, count = self.parted(parent, length=True), self.setting.log.count
        if parted is not None and parted.left < (1 + EVENT_LEAVES) * count:
            return True
        beside = [self._parted_after(begun, length=True) for begun in self._begun(parent)[:1] if not _slow(begun)]
        return any(parted is not None and parted.left < (1 + OPEN) * count for parted in beside)

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

    def _swapped(self, best: Attempt) -> Attempt:
        """Each effect of a pair is replaced by the best others, the rest kept."""
        for name in sorted(best.names - set(self.always)):
            if self.tired:
                break
            rest = {n: v for n, v in best.values.items() if n != name}
            without = self.attempts.get(frozenset(rest)) or self.try_values(rest)
            decided = without is not None and name in STRUCTURES and without.fit.chi2 > FAR_BEHIND * best.fit.chi2
            if without is not None and not decided:
                starts = self.setting.starts(without.values)
                scored = signatures(self.setting, without.fit, without.values, possible(self.setting))
                likely = sorted(scored.of, key=lambda n: -scored.drop(n))[:CHILDREN]
                for other in sorted({*likely, *(mates_of(frozenset({name})) & set(scored.of))}):
                    if frozenset({*rest, other}) not in self.attempts:
                        self._try_lasting(without, other, starts)
        found = self.best()
        return found if self.worth(best, found) or len(found.values) <= len(best.values) else best

    def _dropped(self, best: Attempt) -> Attempt:
        """Without what is not worth its name."""
        for name in sorted(best.names - SEEN):
            rest = {n: v for n, v in best.values.items() if n != name}
            without = self.try_values(rest, rounds=POLISH_ROUNDS, beyond=np.inf if best.open else self._rival_chi2())
            if without is not None and not self.worth(without, best):
                return self._dropped(without)
        return best


def possible(setting: Setting) -> tuple[str, ...]:
    """Lasting effects that the recording could show: without a temperature none shows a drift by it."""
    return tuple(n for n in LASTING if n != "thermal_drift" or setting.log.temperature_c is not None)


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
