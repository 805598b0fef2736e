"""What each suspect would leave in the recordings of a manoeuvre, beyond what initial motion and beliefs could take up."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.parameter import Parameter, Value
from gateway.twin.experiment_design.experiment import INPUTS, Experiment, Run
from gateway.twin.experiment_design.hypotheses import Group, Hypothesis, is_amplitude
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.residual.isolability import orthonormal
from gateway.twin.simulation import DEFAULT_RATE_HZ
from gateway.twin.simulator.parameter_vector import ParameterSpec
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, RIGGING_RATES, RIGGING_TILTS, ROPE_RATES, ROPE_TILTS

Array = NDArray[np.float64]
ENOUGH_HZ = 10.0
"""A swing needs no more; what more samples would bring is in the noise, made smaller."""
WARMS_BY_C = 5.0
EVENTS_FROM, APART_S = 0.4, 0.013
"""Suspected events start at this share of a recording, and never two at the very same time."""
LOST = 1e-6
"""A trace of which less is left is rounding."""
RATES = frozenset({"rope_length", "clock_drift", "sample_loss"})
BELIEVED_TO = {"rope_length.relative_error": 0.05, "housing_position.error_m": 0.05}
"""One sigma of what a drawing or a tape measure says: no separation may rest on more."""
DONE_TO = {
    "housing_spin.rate_deg_s": 0.5,
    "hoisting.speed_m_s": 5e-3,
    "hoisting.start_s": 1.0,
    "hoisting.duration_s": 0.2,
}
"""One sigma of what an operator does: a hand turns evenly to some ten per cent, a drive's own read-out is better."""


@dataclass(frozen=True, slots=True)
class Signature:
    """Of one suspect, in sigma of the rig's noise, over all samples and axes of a manoeuvre."""

    freedom: Array
    """All that its parameters can do, shape (m, parameters)."""
    typical: Array
    """One column for each component that says how strong it is, at its typical size, shape (m, components)."""


@dataclass(frozen=True, slots=True)
class ExperimentSensitivities:
    """Of a manoeuvre's recordings, in sigma, initial motion and the operator's inputs projected out."""

    slots: tuple[ParameterSpec, ...]
    columns: Array
    """Shape (m, slots): all samples and axes of all recordings."""

    def pair(self, first: Hypothesis, second: Hypothesis) -> tuple[Signature, Signature]:
        """Traces of two suspects, with the beliefs that stay free beside them projected out."""
        free = fitted_along(first.effect, second.effect)
        shared = [i for i, slot in enumerate(self.slots) if slot.effect in free]
        known = np.array([1 / BELIEVED_TO[self.slots[i].label] for i in shared])
        return self._trace(first, shared, known), self._trace(second, shared, known)

    def _trace(self, suspect: Hypothesis, shared: list[int], known: Array) -> Signature:
        own = [i for i, slot in enumerate(self.slots) if suspect.has(slot)]
        left = residual_after_projection(self.columns[:, own], self.columns[:, shared], known)
        parameters = [_parameter(self.slots[i]) for i in own]
        strong = [k for k, p in enumerate(parameters) if is_amplitude(p)]
        return Signature(left, left[:, strong] * [_size(parameters[k]) for k in strong])


def residual_after_projection(columns: Array, nuisances: Array, known: Array) -> Array:
    """What is left of columns (m, k) beside nuisances (m, q) that are known to 1/`known` (q,), 0 for not at all.

    What is known counts as q more observations, below the m.
    """
    basis = orthonormal(np.concatenate([nuisances, np.diag(known)]))
    extended = np.concatenate([columns, np.zeros((len(known), columns.shape[1]))])
    left: Array = extended - basis @ (basis.T @ extended)
    left[:, np.linalg.norm(left, axis=0) < LOST * np.linalg.norm(extended, axis=0)] = 0.0
    return left


def fitted_along(*names: str) -> set[str]:
    """Beliefs that stay free beside these effects: of those that set the rate of the swing only beside none of the same."""
    beliefs = {label.partition(".")[0] for label in BELIEVED_TO}
    return {each for each in beliefs if each not in names and not (each in RATES and not RATES.isdisjoint(names))}


def sensitivities(rig: TwinRig, believed: EffectValues, manoeuvre: Experiment, group: Group) -> ExperimentSensitivities:
    """By linearisation about the manoeuvre's motion: score test and isolability of a reconciliation do the same.

    What the operator does is fitted along, from where he meant it to be.
    """
    asked = {*fitted_along(), *(suspect.effect for suspect in group)}
    simulator = Simulator(rig, sorted({*believed, *asked, *INPUTS}))
    wanted = [i for i, slot in enumerate(simulator.parameters) if slot.effect in asked]
    legs = [_columns(simulator, believed, leg, group, wanted) for leg in manoeuvre.legs]
    return ExperimentSensitivities(tuple(simulator.parameters[i] for i in wanted), np.concatenate(legs))


def _columns(simulator: Simulator, believed: EffectValues, leg: Run, group: Group, wanted: list[int]) -> Array:
    rig, inputs = simulator.rig, leg.inputs(simulator.rig)
    rate_hz = rig.sample_rate_hz or DEFAULT_RATE_HZ
    sampled_hz = min(rate_hz, ENOUGH_HZ)
    time_s = np.arange(round(leg.duration_s * sampled_hz)) / sampled_hz
    temperature_c = rig.reference_temperature_c + WARMS_BY_C * time_s / leg.duration_s
    at = simulator.values(
        initial_state_of(leg, rig, simulator.structure), {**_working_point(leg, group), **believed, **inputs}
    )
    at[[slot.effect == "housing_position" for slot in simulator.parameters]] += leg.moved_m(rig)
    jacobian = simulator.linearise(at, time_s, temperature_c).jacobian
    noise_g = np.array(rig.noise_g) / math.sqrt(rate_hz / sampled_hz)
    flat = (jacobian / noise_g[:, None]).reshape(-1, len(at))
    own = [
        i
        for i, slot in enumerate(simulator.parameters)
        if (slot.refitted or slot.effect in inputs)
        and i != HEADING  # on one recording a gauge: it turns the world along
    ]
    known = np.array([1 / DONE_TO.get(simulator.parameters[i].label, np.inf) for i in own])
    return residual_after_projection(flat[:, wanted], flat[:, own], known)


def initial_state_of(leg: Run, rig: TwinRig, structure: ModelStructure) -> Array:
    """Return the initial state of a load that is released between the housing's axes, with some speed across; shape (z,).

    Rigging is released in line with the rope.
    """
    amplitude = math.radians(leg.amplitude_deg)
    along = np.array([math.cos(0.5), math.sin(0.5)])
    rate = leg.roundness * rig.small_swing_rate_1_s * amplitude * along[::-1] * [-1, 1]
    start = np.zeros(structure.n_initial_states)
    start[ROPE_TILTS], start[ROPE_RATES], start[HEADING] = amplitude * along, rate, math.radians(leg.heading_deg)
    if structure is ModelStructure.RIGGING:
        start[RIGGING_TILTS], start[RIGGING_RATES] = start[ROPE_TILTS], start[ROPE_RATES]
    return start


def _working_point(leg: Run, group: Group) -> dict[str, Mapping[str, Value]]:
    """Where the suspects are linearised: absent, but losses take energy as they would, and events have their times."""
    names = list(dict.fromkeys(suspect.effect for suspect in group))
    one_sided = [name for name in names if any(_is_loss(p) for p in EFFECTS[name].parameters)]
    point: dict[str, Mapping[str, Value]] = {}
    for i, name in enumerate(names):
        if name in one_sided:
            point[name] = {p.name: _size(p) / len(one_sided) for p in EFFECTS[name].parameters}
        elif EFFECTS[name].transient:
            point[name] = {p.name: _event_value(p, leg, i) for p in EFFECTS[name].parameters}
    return point


def _event_value(p: Parameter, leg: Run, index: int) -> Value:
    """Weak, so that nothing else changes, but there, so that its times matter."""
    if p.name == "start_s":
        return EVENTS_FROM * leg.duration_s + APART_S * index
    if not is_amplitude(p):
        return p.typical
    return (p.scale,) * p.size if p.components else p.scale


def _is_loss(p: Parameter) -> bool:
    return is_amplitude(p) and p.lower == p.neutral == 0


def _size(p: Parameter) -> float:
    return float(np.max(np.abs(p.typical)))


def _parameter(slot: ParameterSpec) -> Parameter:
    return next(p for p in EFFECTS[slot.effect].parameters if p.name == slot.parameter)
