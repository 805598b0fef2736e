"""Identifiability: which effects leave the same signature at a fitted model, and so cannot be told apart.

A signature is how the samples respond to an effect's parameters, by linearisation, with what every recording fits anyway
projected out: initial motion and heading. Two effects with the same signature, where the other effects of the model may change
as well, form an ambiguity group, whatever their fits say (isolability, Basseville and Nikiforov 1993). No value may leave what
is possible and what parts have: an effect that would have to is no alternative.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.plausibility import TAIL_SHARE, limit_of
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE
from gateway.twin.reconcile.fit.fit_context import sensitivities_sigma
from gateway.twin.reconcile.search.signatures import orthonormal, project_out
from gateway.twin.simulator.parameter_vector import ParameterSpec
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]


MAX_INDISTINGUISHABLE_ANGLE_RAD = 3e-3
"""Angle between an effect's contribution and the nearest one of another effect, up to which no evidence separates them: the
equations of the effects are not true to 0.3 % of a contribution (a jib's radius, a clamp that yields)."""


DISTINCT_ANGLE_RAD = 0.1
"""Angle from which two effects differ whatever the model leaves unexplained: losses by different laws are 0.15 apart."""


@dataclass(frozen=True, slots=True)
class FittedRecording:
    """A recording and the initial motion that a model has on it."""

    observations: Observations
    model_effects: EffectValues
    """Effects that the model has on this recording; the inputs of the crane are its own."""
    initial: Array
    """Initial state, heading included, shape (initial states,)."""
    heading_is_fitted: bool
    """False on the log, where the heading is a gauge: turning the world changes nothing."""
    excess_chi2: float
    """Chi-square of the residual beyond what a wrongly stated noise gives: what the model leaves unexplained, 0 or more."""


def indistinguishable_from(
    rig: TwinRig, model: EffectValues, name: str, others: Iterable[str], recordings: Sequence[FittedRecording]
) -> tuple[str, ...]:
    """Effects out of `others` that make the same contribution to all recordings as one effect of a fitted model.

    The most similar one is first.
    """
    size_sigma, angles_rad = contribution_angles(rig, model, name, others, recordings)
    unexplained = sum(each.excess_chi2 for each in recordings)
    # What the model leaves unexplained could be twice the difference between the two effects.
    misfit_rad = 2 * math.sqrt(unexplained) / size_sigma if size_sigma else 0.0
    limit_rad = max(MAX_INDISTINGUISHABLE_ANGLE_RAD, min(misfit_rad, DISTINCT_ANGLE_RAD))
    alike = (other for other, angle in angles_rad.items() if angle < limit_rad)
    return tuple(sorted(alike, key=lambda other: (angles_rad[other], other)))


def contribution_angles(
    rig: TwinRig, model: EffectValues, name: str, others: Iterable[str], recordings: Sequence[FittedRecording]
) -> tuple[float, dict[str, float]]:
    """Size of an effect's contribution at its fitted parameters, and its angle to what each other effect could contribute.

    The size is in sigma of the noise, the norm over all samples and axes; angles are in rad.
    """
    tried = [other for other in others if other not in model and EFFECTS[other].is_scored]
    simulator = Simulator(rig, sorted({*model, *tried}))
    columns = np.concatenate([_project_recording(simulator, rig, model, each) for each in recordings])
    specs = simulator.parameters
    kept = [i for i, spec in enumerate(specs) if spec.effect in model and spec.effect != name and not spec.refitted]
    contribution = columns[:, _places(specs, name)] @ _distance_from_neutral(simulator, model, name)
    basis = orthonormal(columns[:, kept])
    size = float(np.linalg.norm(project_out(basis, contribution)))
    if size == 0.0:
        return 0.0, {}
    lower, upper = possible_changes(simulator, model, rig)
    angles_rad = {}
    for other in tried:
        used = [*_places(specs, other), *kept]
        beyond = distance_within(contribution, columns[:, used], lower[used], upper[used])
        angles_rad[other] = float(np.arcsin(min(1.0, beyond / size)))
    return size, angles_rad


def possible_changes(simulator: Simulator, model: EffectValues, rig: TwinRig) -> tuple[Array, Array]:
    """Return by how much each value may fall and rise from that of the model, (values,) each; effects beside it are neutral.

    The ends are the bounds of the parameter and what parts have: beyond it until the prior density is that of a rival that is no
    alternative (`MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE`). A value of the model that is beyond may stay.
    """
    at = simulator.values([], {name: values for name, values in model.items() if name in simulator.effect_names})
    n = simulator.n_initial_states
    lower, upper = np.full(len(at), -np.inf), np.full(len(at), np.inf)
    beyond = 1 + TAIL_SHARE * math.sqrt(MIN_EVIDENCE_MARGIN_INDISTINGUISHABLE)
    for i, spec in enumerate(simulator.parameters[n:], start=n):
        parameter = next(each for each in EFFECTS[spec.effect].parameters if each.name == spec.parameter)
        limit = limit_of(parameter, rig)
        reach = math.inf if limit is None else beyond * limit
        lower[i] = min(0.0, max(spec.lower, spec.neutral - reach) - at[i])
        upper[i] = max(0.0, min(spec.upper, spec.neutral + reach) - at[i])
    return lower, upper


def distance_within(target: Array, columns: Array, lower: Array, upper: Array) -> float:
    """Distance of a target (m,) from what columns (m, k) reach with coefficients between lower and upper (k,)."""
    norms = np.linalg.norm(columns, axis=0)
    able = (norms > 0) & (lower < upper)
    if not able.any():
        return float(np.linalg.norm(target))
    scale = norms[able]
    # In the basis of the columns the problem has as many rows as unknowns; what is orthogonal to them stays.
    basis, triangle = np.linalg.qr(columns[:, able] / scale)
    inside = basis.T @ target
    found = lsq_linear(triangle, inside, (lower[able] * scale, upper[able] * scale), method="bvls")
    return float(np.hypot(np.linalg.norm(target - basis @ inside), np.linalg.norm(found.fun)))


def _project_recording(simulator: Simulator, rig: TwinRig, model: EffectValues, recording: FittedRecording) -> Array:
    """Sensitivities in sigma of one recording by the simulator's values, its own nuisances projected out, shape (3 n, values)."""
    o = recording.observations
    acting = {
        name: EFFECTS[name].shift_start(values, o.offset_s) if name not in model else values
        for name, values in {**recording.model_effects, **model}.items()
    }
    own = Simulator(rig, sorted({*simulator.effect_names, *acting}))
    at = own.values(recording.initial, acting)
    flat = sensitivities_sigma(own, at, o).reshape(-1, len(own.parameters))
    nuisances = [i for i, spec in enumerate(own.parameters) if spec.refitted]
    if not recording.heading_is_fitted:
        nuisances.remove(HEADING)
    basis = orthonormal(flat[:, nuisances])
    place_of = {spec.label: i for i, spec in enumerate(own.parameters)}
    flat = flat[:, [place_of[spec.label] for spec in simulator.parameters]]
    return project_out(basis, flat)


def _places(specs: Sequence[ParameterSpec], name: str) -> list[int]:
    return [i for i, spec in enumerate(specs) if spec.effect == name and not spec.refitted]


def _distance_from_neutral(simulator: Simulator, model: EffectValues, name: str) -> Array:
    values = simulator.values([], model)
    distance: Array = (values - simulator.neutral())[_places(simulator.parameters, name)]
    return distance
