"""The plan: for each group the manoeuvre that tells most of it apart, for the least effort."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Effect
from gateway.twin.experiment_design.candidates import CANDIDATES, FREE_SWING
from gateway.twin.experiment_design.experiment import Experiment
from gateway.twin.experiment_design.hypotheses import GROUPS, Group, Hypothesis
from gateway.twin.experiment_design.separation import Separation, separation
from gateway.twin.experiment_design.signatures import sensitivities
from gateway.twin.model import EffectValues, TwinRig

ENOUGH_SIGMA = 20.0
"""More than this is worth no effort."""
OFF_THE_ROPE = frozenset({"axis_offset", "mount_misalignment", "cross_axis"})
CALIBRATE = (
    "take the sensor off the rope and calibrate it: "
    "an offset and a cross-axis pick-up come along with it, the mount's tilt does not"
)
OTHER_MEANS = "compare with a second sensor at another place, or with the drives' own signals"
RIVALS = 2


@dataclass(frozen=True, slots=True)
class Pair:
    """Two suspects, in a free swing and with the manoeuvre."""

    first: Hypothesis
    second: Hypothesis
    before: Separation
    after: Separation | None
    """None where no manoeuvre is proposed."""


@dataclass(frozen=True, slots=True)
class GroupPlan:
    """What to do for one group."""

    group: Group
    manoeuvre: Experiment | None
    """None where no candidate tells any pair apart."""
    pairs: tuple[Pair, ...]
    alternatives: tuple[Experiment, ...]
    """Next in rank that tell as many pairs apart, and not by more handwork on top of the same."""
    instead: str | None
    """The measurement that tells apart what no manoeuvre does."""
    tried: int
    """Number of manoeuvres that are possible here."""

    @property
    def is_distinguishable(self) -> bool:
        """All pairs."""
        return all(pair.after is not None and pair.after.is_distinguishable for pair in self.pairs)


@dataclass(frozen=True, slots=True)
class Plan:
    """What to do, group by group."""

    rig: TwinRig
    groups: tuple[GroupPlan, ...]

    @property
    def improves_separation(self) -> bool:
        """Some group has a manoeuvre."""
        return any(each.manoeuvre is not None for each in self.groups)


Forecast = tuple[Experiment, tuple[Separation, ...]]


def plan(
    rig: TwinRig,
    groups: Sequence[Group] = GROUPS,
    tick: Callable[[str], None] = lambda _stage: None,
    believed: EffectValues | None = None,
) -> Plan:
    """Try every candidate on every group; `tick` is told of each. `believed` are the effects that the rig's model has."""
    found = []
    for i, group in enumerate(groups):
        forecasts = []
        for manoeuvre in _possible(rig, believed or {}, group):
            tick(f"group {i + 1} of {len(groups)}")
            forecasts.append((manoeuvre, forecast(rig, believed or {}, manoeuvre, group)))
        found.append(_chosen(group, forecasts))
    return Plan(rig, tuple(found))


def forecast(rig: TwinRig, believed: EffectValues, manoeuvre: Experiment, group: Group) -> tuple[Separation, ...]:
    """Of each pair of a group, in the order of `itertools.combinations`."""
    found = sensitivities(rig, believed, manoeuvre, group)
    return tuple(separation(*found.pair(first, second)) for first, second in combinations(group, 2))


def _possible(rig: TwinRig, believed: EffectValues, group: Group) -> list[Experiment]:
    """What the operator does himself must be no suspect, and must not go on already."""
    taken = {*believed, *(suspect.effect for suspect in group)}
    return [each for each in CANDIDATES if each.possible(rig) and not each.inputs(rig) & taken]


def _chosen(group: Group, forecasts: Sequence[Forecast]) -> GroupPlan:
    before = next(separations for manoeuvre, separations in forecasts if manoeuvre == FREE_SWING)
    ranked = sorted(forecasts, key=lambda each: _rank(each, _splittable(forecasts)))
    best, after = ranked[0]
    told = _count_distinguishable(after)
    rivals = [
        m
        for m, separations in ranked[1:]
        if _count_distinguishable(separations) == told and not m.is_extension_of(best)
    ]
    pairs = tuple(
        Pair(first, second, before[i], after[i] if told else None)
        for i, (first, second) in enumerate(combinations(group, 2))
    )
    left = {
        s.effect for i, pair in enumerate(pairs) if not after[i].is_distinguishable for s in (pair.first, pair.second)
    }
    return GroupPlan(
        group,
        best if told else None,
        pairs,
        tuple(rivals[:RIVALS]) if told else (),
        _alternatives(frozenset(left)) if left else None,
        len(forecasts),
    )


def _splittable(forecasts: Sequence[Forecast]) -> list[int]:
    """Pairs that some candidate tells apart: the others have no say in the ranking."""
    pairs = range(len(forecasts[0][1]))
    return [i for i in pairs if any(separations[i].is_distinguishable for _, separations in forecasts)]


def _rank(each: Forecast, splittable: Sequence[int]) -> tuple[float, ...]:
    """Smallest first: most pairs, then the worst pair's separation up to what is enough, then effort, then separation."""
    manoeuvre, separations = each
    worst = min((separations[i].sigma for i in splittable), default=0.0)
    return (-_count_distinguishable(separations), -min(worst, ENOUGH_SIGMA), manoeuvre.effort_s, -worst)


def _count_distinguishable(separations: Sequence[Separation]) -> int:
    return sum(each.is_distinguishable for each in separations)


def _alternatives(names: frozenset[str]) -> str:
    if names <= OFF_THE_ROPE:
        return CALIBRATE
    texts = dict.fromkeys(EFFECTS[name].discriminating_experiment for name in sorted(names))
    return OTHER_MEANS if Effect.discriminating_experiment in texts else "; ".join(texts)
