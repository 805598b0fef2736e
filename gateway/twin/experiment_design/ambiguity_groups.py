"""The ambiguity groups of an ordinary recording, computed from the signatures of all effects that a score test can rank."""

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.experiment_design.candidates import FREE_SWING
from gateway.twin.experiment_design.hypotheses import Group, Hypothesis, amplitude_parts
from gateway.twin.experiment_design.separation import MIN_SEPARATION_SIGMA
from gateway.twin.experiment_design.signatures import ExperimentSensitivities, linearise_experiment
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.residual.isolability import CONFUSABLE_COSINE, smallest_angle_cosine


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
    edges = [pair for pair in combinations(parts, 2) if _are_confusable(sensitivities, *pair)]
    by_effects: dict[frozenset[str], set[Hypothesis]] = {}
    for nodes in _connected(parts, edges):
        by_effects.setdefault(frozenset(node.effect for node in nodes), set()).update(nodes)
    order = {name: i for i, name in enumerate(EFFECTS)}
    groups = [_merge_parts(nodes) for effects, nodes in by_effects.items() if len(effects) > 1]
    return tuple(sorted(groups, key=lambda group: order[group[0].effect]))


def _are_confusable(sensitivities: ExperimentSensitivities, first: Hypothesis, second: Hypothesis) -> bool:
    if first.effect == second.effect:
        return False
    signatures = sensitivities.signatures(first, second)
    are_visible = all(np.linalg.norm(each.typical) > MIN_SEPARATION_SIGMA for each in signatures)
    one, other = signatures
    return are_visible and smallest_angle_cosine(one.columns, other.columns) > CONFUSABLE_COSINE


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
