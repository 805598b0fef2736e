"""The simulator: predicts a recording, and how it changes with every parameter."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.effect import Effect, ModelStructure, Value
from gateway.twin.effects.limits import LowpassLag
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.compiled_model import compile_model
from gateway.twin.simulator.first_order_lowpass import first_order_lowpass, initial_transient, lowpass_sensitivity
from gateway.twin.simulator.integrate import Trajectory, integrate
from gateway.twin.simulator.parameter_vector import ParameterSpec, effect_parameter_specs, initial_state_specs
from gateway.twin.simulator.symbolic_model import RigSymbols

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Linearisation:
    """A prediction and its derivatives."""

    force_g: Array
    """Shape (n, 3)."""
    jacobian: Array
    """By the simulator's values, shape (n, 3, values)."""


@dataclass(frozen=True, slots=True)
class SegmentBatch:
    """A prediction over segments, each from its own start."""

    force_g: Array
    """Shape (n, 3)."""
    ends: Array
    """Where each segment arrives at the start of the next, in the coordinates of a start, shape (segments, starts)."""
    force_by_start: Array
    """Of each sample by its own segment's start, shape (n, 3, starts)."""
    force_by_effects: Array
    """Shape (n, 3, effect values)."""
    ends_by_start: Array
    """Shape (segments, starts, starts)."""
    ends_by_effects: Array
    """Shape (segments, starts, effect values)."""


class Simulator:
    """A model of fixed structure: its values are the start of the motion and the effects' parameters, in their slots' order."""

    def __init__(self, rig: TwinRig, effect_names: Sequence[str] = ()) -> None:
        """Raises `ValueError` for effects that exclude each other."""
        self.rig = rig
        beliefs = RigSymbols(rig.length_m, rig.position_m, rig.gravity_m_s2, rig.reference_temperature_c)
        self._compiled = compile_model(beliefs, frozenset(effect_names))
        self._effects = self._compiled.assembly.effects
        self.effect_names = tuple(effect.name for effect in self._effects)
        self.initial = initial_state_specs(self._compiled.structure)
        self.effect_parameters = tuple(
            slot for effect in self._effects for slot in effect_parameter_specs(effect, rig.length_m)
        )
        self.parameters: tuple[ParameterSpec, ...] = self.initial + self.effect_parameters
        labels = [slot.label for slot in self.effect_parameters]
        cutoff = f"{LowpassLag.name}.cutoff_hz"
        self._cutoff = labels.index(cutoff) if cutoff in labels else None
        self._limits_output = any(type(each).output_stage_g is not Effect.output_stage_g for each in self._effects)

    @property
    def structure(self) -> ModelStructure:
        """Structure of the model."""
        return self._compiled.structure

    @property
    def n_initial_states(self) -> int:
        """Length of the initial state: 5, with an elastic rope 7, with a double pendulum 9."""
        return len(self.initial)

    def neutral(self) -> Array:
        """All values where nothing acts and the load hangs at rest, shape (values,)."""
        return np.array([slot.neutral for slot in self.parameters])

    def values(self, initial: Sequence[float] | Array, effects: EffectValues) -> Array:
        """Values from a start and the effects' parameters by name; what is not given is neutral."""
        found = self.neutral()
        found[: len(initial)] = initial
        for i, slot in enumerate(self.parameters):
            given = effects.get(slot.effect, {}).get(slot.parameter)
            if given is not None:
                found[i] = given[slot.component] if isinstance(given, (tuple, list)) else given
        return found

    def effects(self, values: Array) -> dict[str, dict[str, Value]]:
        """The effects' parameters by name, as a model has them."""
        numbers = iter(values[self.n_initial_states :].tolist())
        found: dict[str, dict[str, Value]] = {}
        for effect in self._effects:
            taken = {p.name: tuple(next(numbers) for _ in range(p.size)) for p in effect.parameters}
            found[effect.name] = {
                p.name: taken[p.name] if p.components else taken[p.name][0] for p in effect.parameters
            }
        return found

    def predict(self, values: Array, time_s: Array, temperature_c: Array | None = None) -> Array:
        """Readings in g, shape (n, 3), at rising times (n,) of any spacing, n >= 2; the start is at the first of them.

        Event times count from the first sample. `temperature_c` (n,) is needed for `thermal_drift` alone, and without noise.
        Parameters under which the model runs away give numbers that are not finite. Raises `ValueError` for times that do
        not rise, and for parameters that no integration can follow.
        """
        start, p = values[: self.n_initial_states], values[self.n_initial_states :]
        elapsed = _elapsed(time_s)
        flight = integrate(self._compiled, start, p, elapsed[0], elapsed[-1], sensitive=False)
        inputs, _ = self._sampled(flight, elapsed, self._temperature(temperature_c, elapsed), p)
        reading = self._compiled.reading(inputs, p)
        if self._cutoff is not None:
            began_g = p[self._cutoff + 1 : self._cutoff + 4]
            reading = (
                first_order_lowpass(reading, elapsed, p[self._cutoff])
                + initial_transient(elapsed, p[self._cutoff]) * began_g
            )
        return self._compiled.output([reading.T], p) if self._limits_output else reading

    def linearise(self, values: Array, time_s: Array, temperature_c: Array | None = None) -> Linearisation:
        """A prediction as of `predict`, and its derivatives by all values."""
        found = self.linearise_segments(
            values[None, : self.n_initial_states], values[self.n_initial_states :], time_s, [0], temperature_c
        )
        return Linearisation(found.force_g, np.concatenate([found.force_by_start, found.force_by_effects], axis=2))

    def linearise_segments(
        self,
        starts: Array,
        effects: Array,
        time_s: Array,
        firsts: Sequence[int],
        temperature_c: Array | None = None,
    ) -> SegmentBatch:
        """Predict over segments that begin at samples `firsts` (the first is 0) from `starts` (segments, starts).

        `effects` are the effects' values (values after the start's). A segment ends where the next begins, the last at the
        last sample. The low-pass runs on across segments. Of two events that have an edge at the very same time, the
        sensitivities by these times are shared; an edge that passes a sample makes that sample jump.
        """
        elapsed = _elapsed(time_s)
        temperature_c = self._temperature(temperature_c, elapsed)
        bounds = [*firsts, len(time_s)]
        readings, arrivals = [], []
        for start, (first, last) in zip(starts, pairwise(bounds), strict=True):
            until_s = elapsed[min(last, len(elapsed) - 1)]
            flight = integrate(self._compiled, start, effects, elapsed[first], until_s, sensitive=True)
            readings.append(self._readings(flight, elapsed[first:last], temperature_c[first:last], effects))
            arrivals.append(self._sample_time_derivative(flight))
        force, by = self._apply_sensor_dynamics(*_joined(readings), elapsed, effects)
        ends, ends_by = (np.array(each) for each in zip(*arrivals, strict=True))
        n = self.n_initial_states
        return SegmentBatch(force, ends, by[..., :n], by[..., n:], ends_by[..., :n], ends_by[..., n:])

    def _temperature(self, temperature_c: Array | None, elapsed: Array) -> Array:
        if temperature_c is not None:
            return temperature_c
        if any(effect.needs_temperature for effect in self._effects):
            raise ValueError("thermal_drift wants temperature_c, the temperature of each sample")
        return np.zeros_like(elapsed)

    def _sample_time_derivative(self, flight: Trajectory) -> tuple[Array, Array]:
        end, by_state = (each.full() for each in self._compiled.start(flight.ends[-1]))
        return end[:, 0], by_state @ _sensitivities(flight)[1][-1]

    def _sampled(
        self, flight: Trajectory, elapsed: Array, temperature_c: Array, p: Array
    ) -> tuple[list[Array], NDArray[np.int64]]:
        """Inputs of a reading at each sample, and its step."""
        nodes_s, steps_s = flight.grid.nodes_s, flight.grid.steps_s
        true_s = self._compiled.true_time([elapsed], p)[:, 0]
        step = np.clip(np.searchsorted(nodes_s, true_s, side="right") - 1, 0, len(steps_s) - 1)
        ends = [flight.begins[step].T, flight.ends[step].T]
        return [*ends, nodes_s[step], steps_s[step], elapsed, temperature_c], step

    def _readings(self, flight: Trajectory, elapsed: Array, temperature_c: Array, p: Array) -> tuple[Array, Array]:
        """Before the low-pass, with their total derivatives."""
        inputs, step = self._sampled(flight, elapsed, temperature_c, p)
        jacobian = self._compiled.reading_jacobian(inputs, p)
        begins_by, ends_by = _sensitivities(flight)
        k, n = flight.begins.shape[1], self.n_initial_states
        by = jacobian[..., :k] @ begins_by[step] + jacobian[..., k : 2 * k] @ ends_by[step]
        nodes_by = flight.grid.nodes_by
        by[..., n:] += jacobian[..., 2 * k, None] * nodes_by[step][:, None]
        by[..., n:] += jacobian[..., 2 * k + 1, None] * np.diff(nodes_by, axis=0)[step][:, None]
        by[..., n:] += jacobian[..., 2 * k + 2 :]
        return self._compiled.reading(inputs, p), by

    def _apply_sensor_dynamics(self, reading: Array, by: Array, elapsed: Array, p: Array) -> tuple[Array, Array]:
        """Low-pass and clipping, with their sensitivities."""
        if self._cutoff is not None:
            place, cutoff_hz = self.n_initial_states + self._cutoff, p[self._cutoff]
            began_g, fades = p[self._cutoff + 1 : self._cutoff + 4], initial_transient(elapsed, cutoff_hz)
            lagging = first_order_lowpass(reading, elapsed, cutoff_hz)
            by = first_order_lowpass(by, elapsed, cutoff_hz)
            by[..., place] += lowpass_sensitivity(reading, lagging, elapsed, cutoff_hz)
            by[..., place] -= 2 * np.pi * elapsed[:, None] * fades * began_g
            by[..., place + 1 : place + 4] += fades[:, :, None] * np.eye(3)
            reading = lagging + fades * began_g
        if self._limits_output:
            jacobian = self._compiled.output_jacobian([reading.T], p)
            by = jacobian[..., :3] @ by
            by[..., self.n_initial_states :] += jacobian[..., 3:]
            reading = self._compiled.output([reading.T], p)
        return reading, by


def _elapsed(time_s: Array) -> Array:
    elapsed: Array = time_s - time_s[0]
    if len(elapsed) < 2 or not (np.diff(elapsed) > 0).all():
        raise ValueError("a prediction wants two sample times or more, and each later than the one before")
    return elapsed


def _sensitivities(flight: Trajectory) -> tuple[Array, Array]:
    if flight.by is None:
        raise ValueError("this flight was made without sensitivities")
    return flight.by.begins, flight.by.ends


def _joined(pieces: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    force, by = zip(*pieces, strict=True)
    return np.concatenate(force), np.concatenate(by)
