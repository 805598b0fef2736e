"""What stays the same while models are tried."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import ParameterKind
from gateway.twin.effects.guess_context import EventWindow, GuessContext
from gateway.twin.effects.pulse_shape import SHARPEST
from gateway.twin.effects.rope import DoublePendulum
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.initial_conditions import segment_initial_conditions
from gateway.twin.reconcile.fit.modal_parameterisation import ModalSimulator
from gateway.twin.reconcile.fit.multiple_shooting import SEGMENT_S, Fit, uniform_segments
from gateway.twin.reconcile.fit.windowed_fit import fit_trajectory, window_bounds
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
SEARCH_ITERATIONS = 8
RIGGING_FIT_S = 40.0
RIGGING_FIT_ITERATIONS = 5


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
        at = simulator.values([], {**self.model_effects, **values})[simulator.n_initial_states :]
        free, firsts = self.free_parameters(simulator, values), segment_bounds(self.rig, values, self.log)
        if starts is None or starts.shape != (len(firsts), simulator.n_initial_states):
            starts = segment_initial_conditions(simulator, self.log, at, firsts)
        return self._fitted(simulator, self.log, starts, at, free, firsts, rounds, beyond)

    def _fitted(
        self,
        simulator: Simulator,
        observations: Observations,
        starts: Array,
        at: Array,
        free: NDArray[np.bool_],
        firsts: list[int],
        rounds: int,
        beyond: float = np.inf,
    ) -> Fit:
        if DoublePendulum.name not in simulator.effect_names:
            return fit_trajectory(simulator, observations, starts, at, free, firsts, rounds, self.tick, beyond)
        modes = ModalSimulator(self.rig, simulator.effect_names)
        at_mode = modes.to_modal(at)
        with np.errstate(over="ignore", invalid="ignore"):  # no step to a motion that runs away is taken
            fit = fit_trajectory(modes, observations, starts, at_mode, free, firsts, rounds, self.tick, beyond)
            return modes.fit_by_mass(fit)

    def segment_starts(self, values: EffectValues) -> Array:
        """Starts piece by piece under a model, to fit its neighbours from."""
        simulator = self.simulator(tuple(values))
        at = simulator.values([], {**self.model_effects, **values})[simulator.n_initial_states :]
        return segment_initial_conditions(simulator, self.log, at, segment_bounds(self.rig, values, self.log))

    def fit_rigging_length(self, tried: Sequence[EffectValues]) -> EffectValues:
        """Of several rigging lengths, and the one that they point to, the best in a fit of the beginning that holds it.

        As it came out. Rigging and hook make up for each other in a narrow valley; this walks along it in steps.
        """
        beginning = slice_samples(self.log, 0, int(np.searchsorted(self.log.time_s, RIGGING_FIT_S)))
        simulator = self.simulator(tuple(tried[0]))
        firsts = segment_bounds(self.rig, tried[0], beginning)
        rigging = [slot.label for slot in simulator.parameters].index(f"{DoublePendulum.name}.rigging_length_m")
        free = self.free_parameters(simulator, tried[0])
        free[rigging] = False

        def fitted(values: EffectValues) -> list[Fit]:
            at = simulator.values([], {**self.model_effects, **values})[simulator.n_initial_states :]
            try:
                starts = segment_initial_conditions(simulator, beginning, at, firsts)
                fit = self._fitted(simulator, beginning, starts, at, free, firsts, RIGGING_FIT_ITERATIONS)
            except INTEGRATION_FAILURES:
                return []  # the fit ran to parameters that no integration can follow
            return [fit] if np.isfinite(fit.chi2) else []

        fits = [fit for values in tried for fit in fitted(values)]
        if not fits:
            return tried[0]
        between = _parabolic_minimum(
            np.log([fit.values[rigging] for fit in fits]), np.array([fit.chi2 for fit in fits])
        )
        if between is not None:
            modes = ModalSimulator(self.rig, simulator.effect_names)
            by_mode = modes.to_modal(min(fits, key=lambda each: each.chi2).values)
            by_mode[rigging] = np.exp(between)
            found = simulator.effects(modes.to_physical(by_mode))
            fits += fitted({name: found[name] for name in tried[0]})
        best = simulator.effects(min(fits, key=lambda each: each.chi2).values)
        return {name: best[name] for name in tried[0]}

    def free_parameters(self, simulator: Simulator, values: EffectValues) -> NDArray[np.bool_]:
        """The initial motion but for the heading, the phases, and the parameters of effects that are not believed."""
        free = np.array([slot.refitted or slot.effect in values for slot in simulator.parameters])
        free[HEADING] = False
        for i, slot in enumerate(simulator.parameters):
            is_edge = slot.kind is ParameterKind.EDGE
            # Sharp edges stay sharp: their place decides, not their form.
            free[i] &= not (is_edge and values.get(slot.effect, {}).get(slot.parameter) == SHARPEST)
        return free


def _parabolic_minimum(at: Array, chi2: Array) -> float | None:
    """Where the parabola through the least of rising places and its neighbours is lowest; None at an end."""
    k = int(np.argmin(chi2))
    if not 0 < k < len(at) - 1:
        return None
    slopes, middles = np.diff(chi2[k - 1 : k + 2]) / np.diff(at[k - 1 : k + 2]), (at[k - 1 : k + 1] + at[k : k + 2]) / 2
    return float(middles[0] - slopes[0] * (middles[1] - middles[0]) / (slopes[1] - slopes[0]))
