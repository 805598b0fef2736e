"""The context of a fit: rig, model, recording. It chooses segments, free parameters and initial guesses."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import SHARPEST, EventWindow, GuessContext
from gateway.twin.effects.parameter import ParameterKind
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.crane_inputs import CraneInput
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.initial_conditions import hides_sign_of_swing, reverse_swing, segment_initial_conditions
from gateway.twin.reconcile.fit.initial_states import window_bounds
from gateway.twin.reconcile.fit.multiple_shooting import (
    FIT_ITERATIONS,
    SCREENING_ITERATIONS,
    SEGMENT_S,
    Fit,
    FitProblem,
    fit_model,
    uniform_segments,
)
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
SEGMENT_PERIODS = 6.5
"""Longest segment of a short rope, in periods: a rope that is wrong by 3 % shifts the phase by a tenth of a turn over it."""
NO_SHAPES: EffectValues = MappingProxyType({})
FIRST_PART_S = 40.0
"""Length of the first part of the log, on which guesses are compared: it contains several beats of two modes."""


def segment_bounds(rig: TwinRig, values: EffectValues, observations: Observations) -> list[int]:
    """Return the first samples of the segments over which a model is fitted.

    An effect whose state the initial state does not contain, such as a low-pass filter, has a single segment.
    """
    if observations.has_large_amplitude:
        return window_bounds(rig, observations)
    if any(EFFECTS[name].needs_single_segment for name in values):
        return [0]
    longest_s = min(SEGMENT_S, SEGMENT_PERIODS * rig.small_swing_period_s)
    return uniform_segments(observations, min([longest_s, *(EFFECTS[name].segment_s for name in values)]))


def sensitivities_sigma(simulator: Simulator, values: Array, observations: Observations) -> Array:
    """Return the derivatives of a model's readings by its values (k,), in sigma of a recording, shape (n, 3, k)."""
    found = simulator.linearise(values, observations.time_s, observations.temperature_c)
    return found.jacobian * observations.per_sigma[:, :, None]


def is_world_directed(names: Iterable[str]) -> bool:
    """Return whether one of these effects has a direction in the world, so that the heading is identifiable."""
    return any(EFFECTS[name].world_directed for name in names)


def refitted_parameters(simulator: Simulator, values: EffectValues, duration_s: float) -> NDArray[np.bool_]:
    """Return which values belong to a recording of this duration; those of a crane's input only where it acts in it."""
    refitted = np.array([each.refitted for each in simulator.parameters])
    for name in simulator.effect_names:
        effect = EFFECTS[name]
        if isinstance(effect, CraneInput):
            from_s, to_s = effect.interval_s(values[name])
            if to_s <= 0 or from_s >= duration_s:
                refitted &= np.array([each.effect != name for each in simulator.parameters])
    return refitted


@dataclass(frozen=True, slots=True)
class FitContext:
    """The rig, the effects that its model already has, the recording, and who is informed of progress."""

    rig: TwinRig
    model_effects: EffectValues
    log: Observations
    tick: Callable[[], None]

    @property
    def crane_inputs(self) -> tuple[str, ...]:
        """Names of the inputs of the crane that are known."""
        return tuple(name for name in self.model_effects if isinstance(EFFECTS[name], CraneInput))

    @property
    def stated_effects(self) -> EffectValues:
        """The effects that the rig states, without the inputs of the crane."""
        return {name: each for name, each in self.model_effects.items() if name not in self.crane_inputs}

    def simulator(self, names: frozenset[str] | tuple[str, ...]) -> Simulator:
        """Return the simulator of the model's effects and these."""
        return Simulator(self.rig, sorted({*self.model_effects, *names}))

    def work_per_evaluation(self, values: EffectValues) -> float:
        """Derivatives of states and readings in one linearisation of a model: its cost, but for the speed of the machine."""
        simulator = self.simulator(tuple(values))
        steps = self.log.duration_s / simulator.step_s(simulator.values([], {**self.model_effects, **values}))
        readings = 3 * len(self.log.time_s)
        return float((steps * simulator.n_states + readings) * len(simulator.parameters))

    def guess_context(
        self, residual_g: Array, windows: tuple[EventWindow, ...] = (), changepoints: EventWindow | None = None
    ) -> GuessContext:
        """Return what effects make their initial guesses from: the recording and a residual (n, 3) of the model so far."""
        log = self.log
        known = (self.rig.length_m, self.rig.gravity_m_s2, log.time_s, log.force_g, log.noise_g)
        return GuessContext(*known, residual_g, windows, changepoints)

    def fit(
        self,
        values: EffectValues,
        initial_states: Array | None = None,
        iterations: int = FIT_ITERATIONS,
        give_up_above: float = np.inf,
    ) -> Fit:
        """Fit initial conditions and all effects in `values`, from these values; the model's other effects keep theirs."""
        problem = self.problem(values)
        simulator, first_samples = problem.simulator, problem.first_samples
        effect_values = self.effect_values(simulator, values)
        if initial_states is None or initial_states.shape != (len(first_samples), simulator.n_initial_states):
            initial_states = segment_initial_conditions(simulator, self.log, effect_values, first_samples)
        starts = [initial_states]
        if hides_sign_of_swing(self.rig) and any(EFFECTS[name].length_like for name in values):
            starts.append(reverse_swing(initial_states, simulator.structure))
        fits = (fit_model(problem, each, effect_values, iterations, give_up_above) for each in starts)
        return min(fits, key=lambda fit: fit.chi2)

    def problem(self, values: EffectValues) -> FitProblem:
        """Return the fit of the effects in `values`; the model's other effects keep theirs."""
        simulator = self.simulator(tuple(values))
        free, first_samples = self.free_parameters(simulator, values), segment_bounds(self.rig, values, self.log)
        return FitProblem(simulator, self.log, free, first_samples, self.tick)

    def at_rest_beside(
        self, fit: Fit, values: EffectValues, tried: Iterable[str], shapes: EffectValues = NO_SHAPES
    ) -> tuple[Simulator, Array]:
        """Return the simulator of a fitted set with effects at rest beside it, and its values; those have these `shapes`."""
        simulator, fitted = self.simulator((*values, *tried)), self.simulator(tuple(values)).effects(fit.values)
        return simulator, simulator.values(fit.values[: simulator.n_initial_states], {**shapes, **fitted})

    def segment_starts(self, values: EffectValues) -> Array:
        """Return the initial states of the segments under a model, as initial guesses for similar models."""
        simulator = self.simulator(tuple(values))
        first_samples = segment_bounds(self.rig, values, self.log)
        return segment_initial_conditions(simulator, self.log, self.effect_values(simulator, values), first_samples)

    def best_of_guesses(self, guesses: Sequence[EffectValues]) -> EffectValues:
        """Return the best of several guesses after short fits of the first part of the log."""
        first_part = replace(self, log=slice_samples(self.log, 0, int(np.searchsorted(self.log.time_s, FIRST_PART_S))))
        fits = []
        for values in guesses:
            try:
                fits.append(first_part.fit(values, iterations=SCREENING_ITERATIONS))
            except INTEGRATION_FAILURES:
                continue
        if not fits:
            return guesses[0]
        best = min(fits, key=lambda fit: fit.chi2 if np.isfinite(fit.chi2) else np.inf)
        effects = self.simulator(tuple(guesses[0])).effects(best.values)
        return {name: effects[name] for name in guesses[0]}

    def effect_values(self, simulator: Simulator, values: EffectValues) -> Array:
        """Return the simulator's effect values (k,) for these effects and the model's own."""
        return simulator.values([], {**self.model_effects, **values})[simulator.n_initial_states :]

    def free_parameters(self, simulator: Simulator, values: EffectValues) -> NDArray[np.bool_]:
        """Return which values are fitted: initial conditions without the heading, phases, and the effects in `values`.

        The edges of a pulse that is a step stay so: when they are determines the fit, not their shape.
        """
        free = refitted_parameters(simulator, {**self.model_effects, **values}, self.log.duration_s)
        free |= np.array([each.effect in values for each in simulator.parameters])
        free[HEADING] = False
        for i, parameter in enumerate(simulator.parameters):
            value = values.get(parameter.effect, {}).get(parameter.name)
            free[i] &= not (parameter.kind is ParameterKind.EDGE and value == SHARPEST)
        return free
