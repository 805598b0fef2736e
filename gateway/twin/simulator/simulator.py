"""The simulator: the prediction of a recording, and its derivatives by all parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.sensor import LowpassLag
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.compiled_model import compile_model
from gateway.twin.simulator.first_order_lowpass import first_order_lowpass, initial_transient, lowpass_sensitivity
from gateway.twin.simulator.integrate import Trajectory, integrate
from gateway.twin.simulator.sensitivities import evaluate_inside, visit_sensitivities
from gateway.twin.simulator.state import ParameterSpec, effect_parameter_specs, initial_state_specs, state_size
from gateway.twin.simulator.symbolic_model import NominalRig

Array = NDArray[np.float64]


SAMPLES_AT_ONCE = 1024
"""Samples whose intermediate results are computed together. Basis: a choice; they stay in the processor's cache."""
LARGEST_NUMBER = 1e100
"""Value from which on a prediction or a derivative has diverged. Basis: a choice; far above any result, and its square is still a
float."""


@dataclass(frozen=True, slots=True)
class Linearisation:
    """A prediction with its derivatives."""

    force_g: Array
    """Shape (n, 3)."""
    jacobian: Array
    """Derivatives by the parameter vector, shape (n, 3, values)."""


@dataclass(frozen=True, slots=True)
class SegmentBatch:
    """A prediction over segments, each from its own initial state."""

    force_g: Array
    """Shape (n, 3)."""
    ends: Array
    """State of each segment at the start of the next, in the coordinates of an initial state z, shape (segments, z)."""
    force_by_start: Array
    """Derivatives of each sample by the initial state of its segment, shape (n, 3, z)."""
    force_by_effects: Array
    """Derivatives by the parameters of the effects, shape (n, 3, effect values)."""
    ends_by_start: Array
    """Shape (segments, z, z)."""
    ends_by_effects: Array
    """Shape (segments, z, effect values)."""

    @property
    def is_finite(self) -> bool:
        """Whether no segment diverges, derivatives included: solvers need numbers whose squares are numbers."""
        arrays = (self.force_g, self.ends, self.force_by_start, self.force_by_effects, self.ends_by_start)
        return all(bool((np.abs(each) < LARGEST_NUMBER).all()) for each in (*arrays, self.ends_by_effects))


class Simulator:
    """A rig with a set of effects; its parameter vector is the initial state, then the parameters of the effects."""

    def __init__(self, rig: TwinRig, effect_names: Sequence[str] = ()) -> None:
        """Compile the model. Raises `ValueError` for effects that exclude each other."""
        self.rig = rig
        nominal = NominalRig(
            rig.length_m, rig.position_m, rig.is_placed_from_load, rig.gravity_m_s2, rig.reference_temperature_c
        )
        self._effects = tuple(effect for name, effect in EFFECTS.items() if name in set(effect_names))
        self._compiled = compile_model(nominal, self._effects)
        self.effect_names = tuple(effect.name for effect in self._effects)
        self.initial = initial_state_specs(self._compiled.structure)
        self.effect_parameters = tuple(
            spec for effect in self._effects for spec in effect_parameter_specs(effect, rig.length_m)
        )
        self.parameters: tuple[ParameterSpec, ...] = self.initial + self.effect_parameters
        labels = [spec.label for spec in self.effect_parameters]
        cutoff = f"{LowpassLag.name}.cutoff_hz"
        self._cutoff = labels.index(cutoff) if cutoff in labels else None
        self._has_output_stage = any(type(each).output_stage_g is not Effect.output_stage_g for each in self._effects)

    @property
    def structure(self) -> ModelStructure:
        """Structure of the model."""
        return self._compiled.structure

    @property
    def n_initial_states(self) -> int:
        """Length of the initial state: 5, with an elastic rope 7, with a double pendulum 9."""
        return len(self.initial)

    @property
    def n_states(self) -> int:
        """Length of the state of the motion."""
        return state_size(self._compiled.structure)

    def step_s(self, values: Array) -> float:
        """Longest step of the integration at these values. Raises `IntegrationError` where none can follow them."""
        return self._compiled.step_s(values[self.n_initial_states :])

    def neutral(self) -> Array:
        """Return the parameter vector of a load that hangs at rest without any effect, shape (values,)."""
        return np.array([spec.neutral for spec in self.parameters])

    def values(self, initial: Sequence[float] | Array, effects: EffectValues) -> Array:
        """Return the parameter vector of an initial state and of effects by name; what is not given is neutral."""
        vector = self.neutral()
        vector[: len(initial)] = initial
        for i, spec in enumerate(self.parameters):
            given = effects.get(spec.effect, {}).get(spec.name)
            if given is not None:
                vector[i] = spec.convert(given[spec.component] if isinstance(given, (tuple, list)) else given)
        return vector

    def effects(self, values: Array) -> dict[str, dict[str, Value]]:
        """Return the parameters of the effects by name, as a model has them."""
        own = zip(self.effect_parameters, values[self.n_initial_states :].tolist(), strict=True)
        numbers = (spec.convert(number) for spec, number in own)
        found: dict[str, dict[str, Value]] = {}
        for effect in self._effects:
            taken = {p.name: tuple(next(numbers) for _ in range(p.size)) for p in effect.parameters}
            found[effect.name] = {
                p.name: taken[p.name] if p.components else taken[p.name][0] for p in effect.parameters
            }
        return found

    def predict(self, values: Array, time_s: Array, temperature_c: Array | None = None) -> Array:
        """Return the readings in g, shape (n, 3), at n >= 2 ascending times of any spacing, without noise.

        The initial state is that at the first sample, and the times of events count from it. Only effects of the temperature
        need `temperature_c` (n,). Parameters under which the model diverges give numbers that are not finite. Raises
        `ValueError` for times that do not ascend, and `IntegrationError` for parameters that no integration can follow.
        """
        initial, p = values[: self.n_initial_states], values[self.n_initial_states :]
        recorded_s = _recorded_time(time_s)
        trajectory = integrate(self._compiled, initial[None, :], p, [(recorded_s[0], recorded_s[-1])])
        temperature_c = self._temperature(temperature_c, recorded_s)
        samples = self._locate(trajectory, recorded_s, [0], p)
        reading = self._compiled.reading(self._reading_inputs(trajectory, samples, temperature_c), p)
        if self._cutoff is not None:
            cutoff_hz, initial_g = 1 / p[self._cutoff], p[self._cutoff + 1 : self._cutoff + 4]
            transient = initial_transient(recorded_s, cutoff_hz)
            reading = first_order_lowpass(reading, recorded_s, cutoff_hz) + transient * initial_g
        return self._compiled.output([reading.T], p) if self._has_output_stage else reading

    def linearise(self, values: Array, time_s: Array, temperature_c: Array | None = None) -> Linearisation:
        """Return the prediction with its derivatives by the whole parameter vector; arguments as of `predict`."""
        n = self.n_initial_states
        batch = self.linearise_segments(values[None, :n], values[n:], time_s, [0], temperature_c)
        return Linearisation(batch.force_g, np.concatenate([batch.force_by_start, batch.force_by_effects], axis=2))

    @np.errstate(over="ignore", invalid="ignore")  # see `SegmentBatch.is_finite`
    def linearise_segments(
        self, starts: Array, effects: Array, time_s: Array, firsts: Sequence[int], temperature_c: Array | None = None
    ) -> SegmentBatch:
        """Predict segments that begin at the samples `firsts` (the first is 0) from the initial states `starts` (segments, z).

        `effects` are the parameters of the effects. A segment ends where the next begins, the last one at the last sample.
        The state of the low-pass continues across segments. Two events with a discontinuity at the same time share the
        sensitivity by that time; a discontinuity that passes a sample makes this sample jump.
        """
        recorded_s = _recorded_time(time_s)
        ends_s = [recorded_s[min(last, len(recorded_s) - 1)] for last in (*firsts[1:], len(recorded_s))]
        bounds_s = list(zip(recorded_s[list(firsts)], ends_s, strict=True))
        trajectory = integrate(self._compiled, starts, effects, bounds_s)
        samples = self._locate(trajectory, recorded_s, firsts, effects)
        inputs = self._reading_inputs(trajectory, samples, self._temperature(temperature_c, recorded_s))
        reading, by, ends_by = self._linearise_readings(trajectory, starts, inputs, samples, effects)
        force, by = self._apply_sensor_dynamics(reading, by, recorded_s, effects)
        ends, ends_by = self._final_states(trajectory, ends_by)
        n = self.n_initial_states
        return SegmentBatch(force, ends, by[..., :n], by[..., n:], ends_by[..., :n], ends_by[..., n:])

    def _temperature(self, temperature_c: Array | None, recorded_s: Array) -> Array:
        if temperature_c is not None:
            return temperature_c
        needing = [effect.name for effect in self._effects if effect.needs_temperature]
        if needing:
            raise ValueError(f"{needing[0]} needs temperature_c, the temperature of each sample")
        return np.zeros_like(recorded_s)

    def _final_states(self, trajectory: Trajectory, by: Array) -> tuple[Array, Array]:
        """Return the last state of each segment in the coordinates of an initial state, with its derivatives."""
        last = trajectory.first_steps[1:] - 1
        found = [[each.full() for each in self._compiled.initial_state(trajectory.ends[step])] for step in last]
        ends = np.array([z[:, 0] for z, _ in found])
        return ends, np.array([z_by_x for _, z_by_x in found]) @ by

    def _locate(self, trajectory: Trajectory, recorded_s: Array, firsts: Sequence[int], p: Array) -> "_Samples":
        true_s = self._compiled.true_time([recorded_s], p)[:, 0]
        step = trajectory.steps_at(true_s, firsts)
        return _Samples(recorded_s, step, (true_s - trajectory.begins_s[step]) / trajectory.lengths_s[step])

    def _reading_inputs(self, trajectory: Trajectory, samples: "_Samples", temperature_c: Array) -> list[Array]:
        """Return the inputs of the reading at each sample."""
        state = _evaluated(trajectory.polynomials()[samples.step], samples.share)
        return [state.T, samples.recorded_s, trajectory.middles_s[samples.step], temperature_c]

    def _linearise_readings(
        self, trajectory: Trajectory, starts: Array, inputs: list[Array], samples: "_Samples", p: Array
    ) -> tuple[Array, Array, Array]:
        """Return the readings before the low-pass, their total derivatives, and those of the states at the segments' ends."""
        jacobian = self._compiled.reading.jacobian(inputs, p)
        states, n = trajectory.starts.shape[1], self.n_initial_states
        by = np.empty((*jacobian.shape[:2], n + len(p)))

        def visit(steps: slice, polynomials: Array) -> None:
            begin, end = samples.step.searchsorted([steps.start, steps.stop])
            for first in range(begin, end, SAMPLES_AT_ONCE):
                part = slice(first, min(first + SAMPLES_AT_ONCE, end))
                inside = evaluate_inside(polynomials, samples.step[part] - steps.start, samples.share[part])
                by[part] = jacobian[part, :, :states] @ inside

        ends_by = visit_sensitivities(self._compiled, trajectory, starts, p, visit)
        by[..., n:] += jacobian[..., states:]
        true_by = self._compiled.true_time.jacobian([samples.recorded_s], p)[:, 0]
        if true_by.any():
            rate = _evaluated(_differentiated(trajectory.polynomials()[samples.step]), samples.share)
            rate /= trajectory.lengths_s[samples.step, None]
            by[..., n:] += (jacobian[..., :states] @ rate[:, :, None]) * true_by[:, None]
        return self._compiled.reading(inputs, p), by, ends_by

    def _apply_sensor_dynamics(self, reading: Array, by: Array, recorded_s: Array, p: Array) -> tuple[Array, Array]:
        """Apply the low-pass and the output stage to readings and derivatives."""
        if self._cutoff is not None:
            index, cutoff_hz = self.n_initial_states + self._cutoff, 1 / p[self._cutoff]
            initial_g, transient = p[self._cutoff + 1 : self._cutoff + 4], initial_transient(recorded_s, cutoff_hz)
            filtered = first_order_lowpass(reading, recorded_s, cutoff_hz)
            by = first_order_lowpass(by, recorded_s, cutoff_hz)
            by_cutoff = lowpass_sensitivity(reading, filtered, recorded_s, cutoff_hz)
            by_cutoff -= 2 * np.pi * recorded_s[:, None] * transient * initial_g
            by[..., index] -= cutoff_hz**2 * by_cutoff
            by[..., index + 1 : index + 4] += transient[:, :, None] * np.eye(3)
            reading = filtered + transient * initial_g
        if self._has_output_stage:
            jacobian = self._compiled.output.jacobian([reading.T], p)
            by = jacobian[..., :3] @ by
            by[..., self.n_initial_states :] += jacobian[..., 3:]
            reading = self._compiled.output([reading.T], p)
        return reading, by


@dataclass(frozen=True, slots=True)
class _Samples:
    """Where samples lie in a trajectory."""

    recorded_s: Array
    step: NDArray[np.int64]
    share: Array
    """Of the step that has passed."""


def _evaluated(polynomials: Array, at: Array) -> Array:
    """Return polynomials (n, terms, values), constants first, at n places, shape (n, values)."""
    total: Array = polynomials[:, -1]
    for term in range(polynomials.shape[1] - 2, -1, -1):
        total = total * at[:, None] + polynomials[:, term]
    return total


def _differentiated(polynomials: Array) -> Array:
    exponents = np.arange(1, polynomials.shape[1])
    return polynomials[:, 1:] * exponents[:, None]


def _recorded_time(time_s: Array) -> Array:
    """Return the time since the first sample."""
    recorded_s: Array = time_s - time_s[0]
    if len(recorded_s) < 2 or not (np.diff(recorded_s) > 0).all():
        raise ValueError("a prediction needs two sample times or more, each later than the one before")
    return recorded_s
