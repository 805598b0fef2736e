"""How well recordings separate two hypotheses, and the groups of effects that an ordinary one does not separate."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.experiment_design.experiment import FREE_SWING
from gateway.twin.experiment_design.signatures import (
    ExperimentSensitivities,
    Group,
    Hypothesis,
    Signature,
    amplitude_parts,
    linearise_experiment,
)
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.search.signatures import orthonormal

Array = NDArray[np.float64]
CONFUSABLE_COSINE = 0.95
"""Cosine of the angle from which two effects are hard to distinguish. Basis: less than a third of each signature is its own."""
MIN_SEPARATION_SIGMA = 5.0
"""Smallest residual that separates two hypotheses, in standard deviations of the noise. Basis: 1 in 10^6 by chance."""
MAX_COSINE = 0.9995
"""Largest cosine that separates. Basis: above it less than 3 % of a signature is specific, and no model of a crane is that
accurate."""


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
    basis = orthonormal(fitted.columns)
    residual = true.typical - basis @ (basis.T @ true.typical)
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
