"""Identifiability: which effects leave the same signature at a fitted model, and so cannot be told apart.

A signature is how the samples respond to an effect's parameters, by linearisation, with what every recording fits anyway
projected out: initial motion, heading, and the other effects of the model. Two effects with the same signature form an
ambiguity group, whatever their fits say (isolability, Basseville and Nikiforov 1993).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.residual.isolability import orthonormal
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
    """Effects out of `others` that make the same contribution to all recordings as one effect of a fitted model."""
    size_sigma, angles_rad = contribution_angles(rig, model, name, others, recordings)
    unexplained = sum(each.excess_chi2 for each in recordings)
    # What the model leaves unexplained could be twice the difference between the two effects.
    misfit_rad = 2 * math.sqrt(unexplained) / size_sigma if size_sigma else 0.0
    limit_rad = max(MAX_INDISTINGUISHABLE_ANGLE_RAD, min(misfit_rad, DISTINCT_ANGLE_RAD))
    return tuple(sorted(other for other, angle in angles_rad.items() if angle < limit_rad))


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
    basis = orthonormal(columns[:, kept])
    columns = columns - basis @ (basis.T @ columns)
    contribution = columns[:, _places(specs, name)] @ _distance_from_neutral(simulator, model, name)
    size = float(np.linalg.norm(contribution))
    if size == 0.0:
        return 0.0, {}
    angles_rad = {}
    for other in tried:
        reach = orthonormal(columns[:, _places(specs, other)])
        beyond = contribution - reach @ (reach.T @ contribution)
        angles_rad[other] = float(np.arcsin(min(1.0, float(np.linalg.norm(beyond)) / size)))
    return size, angles_rad


def _project_recording(simulator: Simulator, rig: TwinRig, model: EffectValues, recording: FittedRecording) -> Array:
    """Sensitivities in sigma of one recording by the simulator's values, its own nuisances projected out, shape (3 n, values)."""
    o = recording.observations
    acting = {
        name: EFFECTS[name].shift_start(values, o.offset_s) if name not in model else values
        for name, values in {**recording.model_effects, **model}.items()
    }
    own = Simulator(rig, sorted({*simulator.effect_names, *acting}))
    at = own.values(recording.initial, acting)
    weight = (o.used[:, None] / o.noise_g)[:, :, None]
    found = own.linearise(at, o.time_s, o.temperature_c).jacobian * weight
    flat = found.reshape(-1, len(own.parameters))
    nuisances = [i for i, spec in enumerate(own.parameters) if spec.refitted]
    if not recording.heading_is_fitted:
        nuisances.remove(HEADING)
    basis = orthonormal(flat[:, nuisances])
    place_of = {spec.label: i for i, spec in enumerate(own.parameters)}
    flat = flat[:, [place_of[spec.label] for spec in simulator.parameters]]
    projected: Array = flat - basis @ (basis.T @ flat)
    return projected


def _places(specs: Sequence[ParameterSpec], name: str) -> list[int]:
    return [i for i, spec in enumerate(specs) if spec.effect == name and not spec.refitted]


def _distance_from_neutral(simulator: Simulator, model: EffectValues, name: str) -> Array:
    values = simulator.values([], model)
    distance: Array = (values - simulator.neutral())[_places(simulator.parameters, name)]
    return distance
