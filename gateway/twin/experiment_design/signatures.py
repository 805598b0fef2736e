"""Hypotheses, which are effects or some components of them, and the signature of each, nuisance parameters projected out.

A nuisance is whatever a fit estimates as well: the initial conditions, what the operator does (within the tolerances of an
operator), and the nominal lengths of the rig (within the tolerances of a tape measure).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.errors import InputError
from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.housing import HousingPosition
from gateway.twin.effects.parameter import Parameter, ParameterKind, Value
from gateway.twin.experiment_design.experiment import INPUTS, Experiment, Run
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.search.signatures import orthonormal, project_out
from gateway.twin.simulation import DEFAULT_RATE_HZ, released_state
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, RIGGING_RATES, RIGGING_TILTS, ROPE_RATES, ROPE_TILTS, ParameterSpec

Array = NDArray[np.float64]
MAX_RATE_HZ = 10.0
"""Sample rate that resolves a swing; faster sampling is accounted for in the noise."""
TEMPERATURE_RISE_C = 5.0
"""Rise of the sensor's temperature during a recording."""
EVENT_START_SHARE, EVENT_SPACING_S = 0.4, 0.013
"""Time at which hypothetical events start, over the duration of the recording; and their distance. Basis: a choice; motion before
and after it, and no two events coincide."""
RELEASE_AZIMUTH_RAD = 0.5
"""Azimuth of the release. Basis: a choice; between the axes of the housing, so that neither is favoured."""
ROUNDING = 1e-6
"""Remaining share of a column below which it is a rounding error. Basis: above that of a decomposition of many rows, below a
specific signature (0.03)."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An effect, or some components of it."""

    effect: str
    parts: tuple[str, ...] = ()
    """Names of components, or of parameters without components; empty for all."""

    @property
    def label(self) -> str:
        """`axis_offset[x+y]`, as `parse_hypotheses` reads it."""
        return f"{self.effect}[{'+'.join(self.parts)}]" if self.parts else self.effect

    @property
    def in_words(self) -> str:
        """`axis offset (x, y)`."""
        name = self.effect.replace("_", " ")
        return f"{name} ({', '.join(self.parts)})" if self.parts else name

    def has(self, spec: ParameterSpec) -> bool:
        """Return whether the hypothesis contains a number of a simulator's parameter vector."""
        return spec.effect == self.effect and (not self.parts or spec.part in self.parts)


Group = tuple[Hypothesis, ...]
"""Hypotheses that are to be separated from each other."""


def amplitude_parts(effect: Effect) -> tuple[str, ...]:
    """Return the parts by which a hypothesis may be limited: those that say how strong the effect is."""
    return tuple(part for p in effect.parameters if p.is_amplitude for part in (p.components or (p.name,)))


def parse_hypotheses(text: str) -> Group:
    """Return the hypotheses of `steady_wind,axis_offset[x+y]`. Raises `InputError` for what no experiment can show."""
    group = tuple(_parse_hypothesis(each.strip()) for each in text.split(","))
    if len(group) < 2 or len(set(group)) < len(group):
        raise InputError(f"--effects {text}: name two or more, each once, such as steady_wind,axis_offset[x+y]")
    return group


def _parse_hypothesis(text: str) -> Hypothesis:
    name, bracket, inside = text.partition("[")
    effect = EFFECTS.get(name)
    if effect is None:
        raise InputError(f"--effects {text}: {name!r} is no effect; known are {', '.join(sorted(EFFECTS))}")
    if not effect.linear_at_neutral:
        raise InputError(
            f"--effects {text}: {name} shows in the samples or in their spectrum and not by an experiment; leave it out"
        )
    known = amplitude_parts(effect)
    parts = tuple(inside.removesuffix("]").split("+")) if bracket else ()
    if (bracket and not inside.endswith("]")) or not set(parts) <= set(known):
        raise InputError(f"--effects {text}: write {name}, or {name}[...] with some of {'+'.join(known)}")
    return Hypothesis(name, parts)


@dataclass(frozen=True, slots=True)
class Signature:
    """The signature of one hypothesis over all samples and axes of an experiment, in standard deviations of the noise."""

    columns: Array
    """Derivatives by all its parameters, shape (m, parameters)."""
    typical: Array
    """Changes by each of its amplitudes at the typical size, shape (m, amplitudes)."""


@dataclass(frozen=True, slots=True)
class ExperimentSensitivities:
    """Sensitivities of the recordings of an experiment, initial conditions and the operator's inputs projected out."""

    specs: tuple[ParameterSpec, ...]
    columns: Array
    """In standard deviations of the noise, shape (m, specs), for all samples and axes of all recordings."""

    def signatures(self, first: Hypothesis, second: Hypothesis) -> tuple[Signature, Signature]:
        """Return the signatures of two hypotheses, with the nominal lengths that are fitted beside them projected out."""
        fitted = nominal_values_fitted_with(first.effect, second.effect)
        nuisances = [i for i, spec in enumerate(self.specs) if spec.effect in fitted]
        information = np.array([1 / (self.specs[i].prior_sigma or np.inf) for i in nuisances])
        return self._signature(first, nuisances, information), self._signature(second, nuisances, information)

    def _signature(self, hypothesis: Hypothesis, nuisances: list[int], information: Array) -> Signature:
        own = [i for i, spec in enumerate(self.specs) if hypothesis.has(spec)]
        columns = residual_after_projection(self.columns[:, own], self.columns[:, nuisances], information)
        amplitudes = [k for k, i in enumerate(own) if self.specs[i].is_amplitude]
        return Signature(columns, columns[:, amplitudes] * [_typical_size(self.specs[own[k]]) for k in amplitudes])


def residual_after_projection(columns: Array, nuisances: Array, information: Array) -> Array:
    """Return columns (m, k) after a fit of nuisances (m, q) with the prior standard deviations 1/`information` (q,).

    A prior counts as one more observation of its nuisance, in a row below the m.
    """
    basis = orthonormal(np.concatenate([nuisances, np.diag(information)]))
    extended = np.concatenate([columns, np.zeros((len(information), columns.shape[1]))])
    residual = project_out(basis, extended)
    residual[:, np.linalg.norm(residual, axis=0) < ROUNDING * np.linalg.norm(extended, axis=0)] = 0.0
    return residual


def nominal_values_fitted_with(*names: str) -> set[str]:
    """Return the corrections of nominal lengths that are fitted beside these effects.

    A correction that scales the period is not fitted beside an effect that does so, too.
    """
    scaling = EFFECTS.choose(scales_period=True)
    corrections = [name for name, effect in EFFECTS.items() if any(p.prior_sigma for p in effect.parameters)]
    has_scaling = any(name in scaling for name in names)
    return {each for each in corrections if each not in names and not (has_scaling and each in scaling)}


def linearise_experiment(
    rig: TwinRig, model_effects: EffectValues, experiment: Experiment, hypotheses: Group
) -> ExperimentSensitivities:
    """Return the sensitivities of an experiment to hypotheses, by linearisation of its motion.

    What the operator does is fitted as well, from the intended values.
    """
    asked = {*nominal_values_fitted_with(), *(hypothesis.effect for hypothesis in hypotheses)}
    simulator = Simulator(rig, sorted({*model_effects, *asked, *INPUTS}))
    kept = [i for i, spec in enumerate(simulator.parameters) if spec.effect in asked]
    columns = [_linearise_run(simulator, model_effects, run, hypotheses, kept) for run in experiment.runs]
    return ExperimentSensitivities(tuple(simulator.parameters[i] for i in kept), np.concatenate(columns))


def _linearise_run(
    simulator: Simulator, model_effects: EffectValues, run: Run, hypotheses: Group, kept: Sequence[int]
) -> Array:
    rig, inputs = simulator.rig, run.inputs(simulator.rig)
    rate_hz = rig.sample_rate_hz or DEFAULT_RATE_HZ
    simulated_hz = min(rate_hz, MAX_RATE_HZ)
    time_s = np.arange(round(run.duration_s * simulated_hz)) / simulated_hz
    temperature_c = rig.reference_temperature_c + TEMPERATURE_RISE_C * time_s / run.duration_s
    effects = {**_operating_point(run, hypotheses), **model_effects, **inputs}
    values = simulator.values(initial_state_of(run, rig, simulator.structure), effects)
    values[[spec.effect == HousingPosition.name for spec in simulator.parameters]] += run.position_change_m(rig)
    jacobian = simulator.linearise(values, time_s, temperature_c).jacobian
    noise_g = np.array(rig.noise_g) / math.sqrt(rate_hz / simulated_hz)
    columns = (jacobian / noise_g[:, None]).reshape(-1, len(values))
    nuisances = [
        i
        for i, spec in enumerate(simulator.parameters)
        if (spec.refitted or spec.effect in inputs) and i != HEADING  # on one recording the heading is a gauge
    ]
    # Of an operator's input something is known beforehand, of an initial state nothing.
    information = np.array([1 / (simulator.parameters[i].operator_sigma or np.inf) for i in nuisances])
    return residual_after_projection(columns[:, kept], columns[:, nuisances], information)


def initial_state_of(run: Run, rig: TwinRig, structure: ModelStructure) -> Array:
    """Return the initial state of a load that is released between the housing's axes, with some speed across it; shape (z,).

    Rigging is released in line with the rope.
    """
    start = released_state(rig, structure, math.radians(run.amplitude_deg), run.axis_ratio, RELEASE_AZIMUTH_RAD)
    start[HEADING] = math.radians(run.heading_deg)
    if structure is ModelStructure.RIGGING:
        start[RIGGING_TILTS], start[RIGGING_RATES] = start[ROPE_TILTS], start[ROPE_RATES]
    return start


def _operating_point(run: Run, hypotheses: Group) -> dict[str, Mapping[str, Value]]:
    """Return the values at which the hypotheses are linearised.

    Effects are absent, except that losses share a typical loss of energy, and events are weak and have their times.
    """
    names = list(dict.fromkeys(hypothesis.effect for hypothesis in hypotheses))
    losses = [name for name in names if any(_is_loss(p) for p in EFFECTS[name].parameters)]
    point: dict[str, Mapping[str, Value]] = {}
    for i, name in enumerate(names):
        if name in losses:
            point[name] = {p.name: _typical_size(p) / len(losses) for p in EFFECTS[name].parameters}
        elif EFFECTS[name].transient:
            point[name] = {p.name: _event_value(p, run, i) for p in EFFECTS[name].parameters}
    return point


def _event_value(p: Parameter, run: Run, index: int) -> Value:
    """Return the value of an event's parameter: an amplitude that is small, but not zero, so that its times matter."""
    if p.kind is ParameterKind.START:
        return EVENT_START_SHARE * run.duration_s + EVENT_SPACING_S * index
    if not p.is_amplitude:
        return p.typical
    return (p.scale,) * p.size if p.components else p.scale


def _is_loss(p: Parameter) -> bool:
    """Return whether an amplitude has one sign only, as that of a damping has."""
    return p.is_amplitude and p.lower == p.neutral == 0


def _typical_size(p: Parameter) -> float:
    return float(np.max(np.abs(p.typical)))
