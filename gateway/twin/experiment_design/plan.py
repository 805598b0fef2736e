"""The plan: for each group of hypotheses the experiment that separates most of it with the least effort; as text and as JSON."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import LARGER_SWING, TURN_HOUSING, Effect
from gateway.twin.experiment_design.experiment import CANDIDATES, FREE_SWING, Experiment
from gateway.twin.experiment_design.signatures import (
    Group,
    Hypothesis,
    Signature,
    amplitude_parts,
    linearise_experiment,
)
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.search.signatures import orthonormal, project_out

Array = NDArray[np.float64]
CONFUSABLE_COSINE = 0.95
"""Cosine of the angle from which two effects are hard to distinguish. Basis: less than a third of each signature is its own."""
MIN_SEPARATION_SIGMA = 5.0
"""Smallest residual that separates two hypotheses, in standard deviations of the noise. Basis: 1 in 10^6 by chance."""
MAX_COSINE = 0.9995
"""Largest cosine that separates. Basis: above it less than 3 % of a signature is specific, and no model of a crane is that
accurate."""
ENOUGH_SIGMA = 20.0
"""Separation beyond which more is worth no effort. Basis: a choice; four times the separation that is asked for."""
AMONG_CANDIDATES = frozenset({TURN_HOUSING, LARGER_SWING, Effect.discriminating_experiment})
"""Discriminating experiments that the candidates contain: where they leave a pair, another measurement must help."""
CALIBRATE = (
    "take the sensor off the rope and calibrate it: "
    "its offset and cross-axis sensitivity stay with it, the tilt of the mount does not"
)
OTHER_MEANS = "compare with a second sensor at another place, or with the drives' own signals"
MAX_ALTERNATIVES = 2
"""Further experiments that are printed."""


@dataclass(frozen=True, slots=True)
class Separation:
    """How well the recordings of an experiment separate two hypotheses."""

    cosine: float
    """Cosine of the smallest principal angle of their signatures, nuisance parameters projected out; 1 for equal signatures."""
    sigma: float
    """Residual if one of them, at its typical size and in its worst direction, is replaced by the other; the smaller of both."""

    @property
    def is_distinguishable(self) -> bool:
        """Whether the recordings separate them."""
        return self.sigma >= MIN_SEPARATION_SIGMA and self.cosine < MAX_COSINE

    @property
    def in_words(self) -> str:
        """The same as a part of a table."""
        verdict = "separated" if self.is_distinguishable else "not separated"
        return f"{self.sigma:6.1f} sigma, cosine {self.cosine:.5f}, {verdict:<13}"


def smallest_angle_cosine(first: Array, second: Array) -> float:
    """Return the cosine of the smallest principal angle between two column spaces (Björck and Golub 1973); 0 if one is empty."""
    bases = orthonormal(first), orthonormal(second)
    if not all(each.shape[1] for each in bases):
        return 0.0
    return float(min(1.0, np.linalg.svd(bases[0].T @ bases[1], compute_uv=False)[0]))


def separation_of(first: Signature, second: Signature) -> Separation:
    """Return the separation of two signatures."""
    cosine = smallest_angle_cosine(first.columns, second.columns)
    return Separation(cosine, min(_residual_sigma(first, second), _residual_sigma(second, first)))


def _residual_sigma(true: Signature, fitted: Signature) -> float:
    """Return the smallest residual of a signature of typical size after a fit of another one."""
    residual = project_out(orthonormal(fitted.columns), true.typical)
    return float(np.linalg.svd(residual, compute_uv=False)[-1])


def ambiguity_groups(rig: TwinRig, model_effects: EffectValues) -> tuple[Group, ...]:
    """Return the groups of effects, or of components, that a free swing of this rig hardly separates.

    Each component is a node. Components of two effects are connected if their signatures are nearly parallel and visible.
    Connected components form a group; groups of the same effects, for instance for x and for y, are one.
    """
    parts = [
        Hypothesis(name, (part,))
        for name in EFFECTS.choose(is_scored=True, linear_at_neutral=True)
        for part in amplitude_parts(EFFECTS[name])
    ]
    sensitivities = linearise_experiment(rig, model_effects, FREE_SWING, tuple(parts))
    pairs = [pair for pair in combinations(parts, 2) if pair[0].effect != pair[1].effect]
    edges = [pair for pair in pairs if _are_confusable(*sensitivities.signatures(*pair))]
    by_effects: dict[frozenset[str], set[Hypothesis]] = {}
    for nodes in _connected(parts, edges):
        by_effects.setdefault(frozenset(node.effect for node in nodes), set()).update(nodes)
    order = {name: i for i, name in enumerate(EFFECTS)}
    groups = [_merge_parts(nodes) for effects, nodes in by_effects.items() if len(effects) > 1]
    return tuple(sorted(groups, key=lambda group: order[group[0].effect]))


def _are_confusable(first: Signature, second: Signature) -> bool:
    are_visible = all(np.linalg.norm(each.typical) > MIN_SEPARATION_SIGMA for each in (first, second))
    return are_visible and smallest_angle_cosine(first.columns, second.columns) > CONFUSABLE_COSINE


def _connected(
    nodes: Iterable[Hypothesis], edges: Iterable[tuple[Hypothesis, Hypothesis]]
) -> list[frozenset[Hypothesis]]:
    """Return the connected components of a graph."""
    component = {node: frozenset({node}) for node in nodes}
    for first, second in edges:
        joined = component[first] | component[second]
        component |= dict.fromkeys(joined, joined)
    return list(dict.fromkeys(component.values()))


def _merge_parts(nodes: Iterable[Hypothesis]) -> Group:
    """Return one hypothesis for each effect, in the order of the vocabulary."""
    found = {part for node in nodes for part in ((node.effect, each) for each in node.parts)}
    group = []
    for name, effect in EFFECTS.items():
        own = tuple(part for part in amplitude_parts(effect) if (name, part) in found)
        if own:
            group.append(Hypothesis(name, () if own == amplitude_parts(effect) else own))
    return tuple(group)


@dataclass(frozen=True, slots=True)
class Pair:
    """Two hypotheses, in a free swing and in the planned experiment."""

    first: Hypothesis
    second: Hypothesis
    before: Separation
    after: Separation | None
    """None if no experiment is planned."""


@dataclass(frozen=True, slots=True)
class GroupPlan:
    """The plan for one group."""

    group: Group
    experiment: Experiment | None
    """None if no candidate separates any pair."""
    pairs: tuple[Pair, ...]
    alternatives: tuple[Experiment, ...]
    """The next in rank that separate as many pairs, and do not only add manual effort."""
    instead: str | None
    """The measurement that separates what no candidate does."""
    tried: int
    """Number of candidates that are possible on the rig."""

    @property
    def is_distinguishable(self) -> bool:
        """Whether the experiment separates all pairs."""
        return all(pair.after is not None and pair.after.is_distinguishable for pair in self.pairs)


@dataclass(frozen=True, slots=True)
class Plan:
    """The plans for all groups."""

    rig: TwinRig
    groups: tuple[GroupPlan, ...]

    @property
    def improves_separation(self) -> bool:
        """Whether some group has an experiment."""
        return any(each.experiment is not None for each in self.groups)


Forecast = tuple[Experiment, tuple[Separation, ...]]


def plan(
    rig: TwinRig,
    groups: Sequence[Group] | None = None,
    tick: Callable[[str], None] = lambda _stage: None,
    model_effects: EffectValues | None = None,
) -> Plan:
    """Compare all candidates for each group; without groups for the ambiguity groups of the rig.

    `tick` is called with the progress for each candidate. `model_effects` are the effects that the rig's model contains.
    """
    effects = model_effects or {}
    groups = ambiguity_groups(rig, effects) if groups is None else groups
    plans = []
    for i, group in enumerate(groups):
        forecasts = []
        # What the operator does is neither a hypothesis nor part of the model.
        taken = {*effects, *(hypothesis.effect for hypothesis in group)}
        for experiment in CANDIDATES:
            if experiment.is_possible(rig) and not experiment.inputs(rig) & taken:
                tick(f"group {i + 1} of {len(groups)}")
                forecasts.append((experiment, forecast(rig, effects, experiment, group)))
        plans.append(_plan_group(group, forecasts))
    return Plan(rig, tuple(plans))


def forecast(rig: TwinRig, model_effects: EffectValues, experiment: Experiment, group: Group) -> tuple[Separation, ...]:
    """Return the separation of each pair of a group, in the order of `itertools.combinations`."""
    sensitivities = linearise_experiment(rig, model_effects, experiment, group)
    return tuple(separation_of(*sensitivities.signatures(*pair)) for pair in combinations(group, 2))


def _plan_group(group: Group, forecasts: Sequence[Forecast]) -> GroupPlan:
    before = dict(forecasts)[FREE_SWING]
    pairs = range(len(before))  # those that no candidate separates do not influence the ranking
    separable = [i for i in pairs if any(separations[i].is_distinguishable for _, separations in forecasts)]
    ranked = sorted(forecasts, key=lambda each: _rank(each, separable))
    best, after = ranked[0]
    separated = _count_distinguishable(after)
    alternatives = [
        experiment
        for experiment, separations in ranked[1:]
        if _count_distinguishable(separations) == separated and not experiment.is_extension_of(best)
    ]
    compared = tuple(
        Pair(first, second, before[i], after[i] if separated else None)
        for i, (first, second) in enumerate(combinations(group, 2))
    )
    confused = {
        hypothesis.effect
        for pair, separation in zip(compared, after, strict=True)
        if not separation.is_distinguishable
        for hypothesis in (pair.first, pair.second)
    }
    return GroupPlan(
        group,
        best if separated else None,
        compared,
        tuple(alternatives[:MAX_ALTERNATIVES]) if separated else (),
        _other_measurement(frozenset(confused)) if confused else None,
        len(forecasts),
    )


def _rank(each: Forecast, separable: Sequence[int]) -> tuple[float, ...]:
    """Return the sort key: most pairs, then the separation of the worst pair up to enough, then effort, then separation."""
    experiment, separations = each
    worst = min((separations[i].sigma for i in separable), default=0.0)
    return (-_count_distinguishable(separations), -min(worst, ENOUGH_SIGMA), experiment.effort_s, -worst)


def _count_distinguishable(separations: Sequence[Separation]) -> int:
    return sum(each.is_distinguishable for each in separations)


def _other_measurement(names: frozenset[str]) -> str:
    """Return a measurement that separates effects which no candidate separates."""
    effects = [EFFECTS[name] for name in sorted(names)]
    texts = dict.fromkeys(effect.discriminating_experiment for effect in effects)
    others = [text for text in texts if text not in AMONG_CANDIDATES]
    if others:
        return "; ".join(others)
    return CALIBRATE if all(effect.enters == "sensor" for effect in effects) else OTHER_MEANS


PREAMBLE = (
    "The residual, in sigma, if one effect of typical size is replaced by the other; a cosine of 1 means the same signature.\n"
    f"Separated: {MIN_SEPARATION_SIGMA:g} sigma or more, and a cosine below {MAX_COSINE:g}. "
    f"Before: a free swing of {FREE_SWING.runs[0].amplitude_deg:g}°, {FREE_SWING.duration_s:.0f} s."
)
FREE_SWING_NOTE = {
    True: " (an ordinary free swing is enough)",
    False: " (an ordinary free swing: no other experiment separates more)",
}
"""By whether it separates all effects of the group."""


def as_text(plan: Plan) -> str:
    """Return the plan for a terminal."""
    return "\n\n".join([PREAMBLE, *(_group_text(each, plan.rig) for each in plan.groups)])


def _group_text(each: GroupPlan, rig: TwinRig) -> str:
    lines = [" | ".join(hypothesis.in_words for hypothesis in each.group)]
    if each.experiment is None:
        lines.append(f"  none of the {each.tried} experiments tried separates these effects")
    else:
        note = FREE_SWING_NOTE[each.is_distinguishable] if each.experiment == FREE_SWING else ""
        lines += [f"  do: {each.experiment.describe(rig)}{note}", f"  takes: {each.experiment.time_needed}"]
        done = (name.replace("_", " ") for name in sorted(each.experiment.inputs(rig)))
        lines += [f"  expect: {name} among the named effects, because you do it" for name in done]
    names = [f"{pair.first.in_words} / {pair.second.in_words}" for pair in each.pairs]
    for name, pair in zip(names, each.pairs, strict=True):
        after = "" if pair.after is None else f"   after {pair.after.in_words}"
        lines.append(f"  {name:<{max(map(len, names))}}  before {pair.before.in_words}{after}".rstrip())
    if each.instead is not None:
        lines.append(f"  {'instead' if each.experiment is None else 'for the others'}: {each.instead}")
    lines += [f"  or: {other.describe(rig)} ({other.time_needed})" for other in each.alternatives]
    return "\n".join(lines)


def as_json(plan: Plan) -> dict[str, Any]:
    """Return the plan for programs; angles in degrees, lengths in metres."""
    return {"rig": asdict(plan.rig), "groups": [_group_json(each, plan.rig) for each in plan.groups]}


def _group_json(each: GroupPlan, rig: TwinRig) -> dict[str, Any]:
    return {
        "effects": [hypothesis.label for hypothesis in each.group],
        "told_apart": each.is_distinguishable,
        "manoeuvre": None if each.experiment is None else _experiment_json(each.experiment, rig),
        "pairs": [
            {
                "first": pair.first.label,
                "second": pair.second.label,
                "before": _separation_json(pair.before),
                "after": None if pair.after is None else _separation_json(pair.after),
            }
            for pair in each.pairs
        ],
        "alternatives": [_experiment_json(other, rig) for other in each.alternatives],
        "instead": each.instead,
        "tried": each.tried,
    }


def _separation_json(separation: Separation) -> dict[str, Any]:
    return {**asdict(separation), "told_apart": separation.is_distinguishable}


def _experiment_json(experiment: Experiment, rig: TwinRig) -> dict[str, Any]:
    return {
        "do": experiment.describe(rig),
        "duration_s": experiment.duration_s,
        "effort_s": experiment.effort_s,
        "recordings": [
            {
                "amplitude_deg": run.amplitude_deg,
                "roundness": run.axis_ratio,
                "duration_s": run.duration_s,
                "heading_deg": run.heading_deg,
                "housing_position_m": rig.position_m + run.position_change_m(rig),
                "model": run.inputs(rig),
            }
            for run in experiment.runs
        ],
    }
