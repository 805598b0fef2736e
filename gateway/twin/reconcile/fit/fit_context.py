"""What stays the same while models are tried."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.guess_context import EventWindow, GuessContext
from gateway.twin.effects.parameter import ParameterKind
from gateway.twin.effects.pulse_shape import SHARPEST
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.initial_conditions import segment_initial_conditions
from gateway.twin.reconcile.fit.multiple_shooting import SEGMENT_S, uniform_segments
from gateway.twin.reconcile.fit.rigging_length import profile_rigging_length
from gateway.twin.reconcile.fit.windowed_fit import fit_trajectory, window_bounds
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
SEARCH_ITERATIONS = 8
RIGGING_FIT_S = 40.0


def segment_bounds(rig: TwinRig, values: EffectValues, observations: Observations) -> list[int]:
    """First samples of the pieces that a model is fitted over; a low-pass remembers the piece before, so it gets one piece."""
    if observations.has_large_amplitude:
        return window_bounds(rig, observations)
    if any(EFFECTS[name].needs_single_segment for name in values):
        return [0]
    return uniform_segments(observations, min([SEGMENT_S, *(EFFECTS[name].segment_s for name in values)]))


def is_world_directed(names: Iterable[str]) -> bool:
    """Whether one of these effects has a direction in the world, so that the housing's heading is identifiable."""
    return any(EFFECTS[name].world_directed for name in names)


@dataclass(frozen=True, slots=True)
class FitContext:
    """The rig, what its model has already, the recording, and who is told of progress."""

    rig: TwinRig
    model_effects: EffectValues
    log: Observations
    tick: Callable[[], None]

    @property
    def large_amplitude(self) -> bool:
        """Whether only the right model follows the recording as one trajectory."""
        return self.log.has_large_amplitude

    def simulator(self, names: frozenset[str] | tuple[str, ...]) -> Simulator:
        """Of the believed effects and these."""
        return Simulator(self.rig, sorted({*self.model_effects, *names}))

    def work_per_evaluation(self, values: EffectValues) -> float:
        """State derivatives that one linearisation of a model evaluates: its cost, but for the speed of the machine."""
        simulator = self.simulator(tuple(values))
        steps = self.log.duration_s / simulator.step_s(simulator.values([], {**self.model_effects, **values}))
        return float(steps * simulator.n_states * len(simulator.parameters))

    def guess_context(
        self, residual_g: Array, windows: tuple[EventWindow, ...] = (), changepoints: EventWindow | None = None
    ) -> GuessContext:
        """What effects make their initial guesses from: the recording and a residual (n, 3) of the model so far."""
        log = self.log
        known = (self.rig.length_m, self.rig.gravity_m_s2, log.time_s, log.force_g, log.noise_g)
        return GuessContext(*known, residual_g, windows, changepoints)

    def fit(
        self, values: EffectValues, starts: Array | None = None, rounds: int = SEARCH_ITERATIONS, beyond: float = np.inf
    ) -> Fit:
        """Fit initial motion and all effects in `values`, from there; believed effects keep their values."""
        simulator = self.simulator(tuple(values))
        at = self.effect_values(simulator, values)
        free, firsts = self.free_parameters(simulator, values), segment_bounds(self.rig, values, self.log)
        if starts is None or starts.shape != (len(firsts), simulator.n_initial_states):
            starts = segment_initial_conditions(simulator, self.log, at, firsts)
        return fit_trajectory(simulator, self.log, starts, at, free, firsts, rounds, self.tick, beyond)

    def segment_starts(self, values: EffectValues) -> Array:
        """Starts piece by piece under a model, to fit its neighbours from."""
        simulator = self.simulator(tuple(values))
        at = self.effect_values(simulator, values)
        return segment_initial_conditions(simulator, self.log, at, segment_bounds(self.rig, values, self.log))

    def fit_rigging_length(self, tried: Sequence[EffectValues]) -> EffectValues:
        """Return the best of several guesses of a double pendulum, and of one between them, after a fit of the first part.

        The guesses differ in the rigging length, which the fit holds.
        """
        names = tuple(tried[0])
        simulator = self.simulator(names)
        beginning = slice_samples(self.log, 0, int(np.searchsorted(self.log.time_s, RIGGING_FIT_S)))
        guesses = [self.effect_values(simulator, values) for values in tried]
        free, first_samples = self.free_parameters(simulator, tried[0]), segment_bounds(self.rig, tried[0], beginning)
        best = profile_rigging_length(simulator, beginning, guesses, free, first_samples, self.tick)
        if best is None:
            return tried[0]
        found = simulator.effects(np.concatenate([np.zeros(simulator.n_initial_states), best]))
        return {name: found[name] for name in names}

    def effect_values(self, simulator: Simulator, values: EffectValues) -> Array:
        """Return the simulator's effect values (k,) for these effects beside the model's own."""
        return simulator.values([], {**self.model_effects, **values})[simulator.n_initial_states :]

    def free_parameters(self, simulator: Simulator, values: EffectValues) -> NDArray[np.bool_]:
        """The initial motion but for the heading, the phases, and the parameters of effects that are not believed."""
        free = np.array([slot.refitted or slot.effect in values for slot in simulator.parameters])
        free[HEADING] = False
        for i, slot in enumerate(simulator.parameters):
            is_edge = slot.kind is ParameterKind.EDGE
            # Sharp edges stay sharp: their place decides, not their form.
            free[i] &= not (is_edge and values.get(slot.effect, {}).get(slot.parameter) == SHARPEST)
        return free
