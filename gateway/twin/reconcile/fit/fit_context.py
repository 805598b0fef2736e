"""What stays the same while models are tried."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.pulse import SHARPEST
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations, piece
from gateway.twin.reconcile.fit.initial_conditions import local_starts
from gateway.twin.reconcile.fit.modal_parameterisation import ByModes
from gateway.twin.reconcile.fit.multiple_shooting import HEADING, SEGMENT_S, Fit, segments_of
from gateway.twin.reconcile.fit.windowed_fit import fit_motion, is_wide, pieces_of
from gateway.twin.simulator.compiled_model import UNFOLLOWED
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
DIRECTED = frozenset({"steady_wind", "wind_gust", "impact", "trolley_acceleration"})
"""Effects with a direction in the world: with one of them, the heading shows."""
SEARCH_ROUNDS = 8
TWO_MODES_SEGMENT_S = 8.0
"""Two modes beat: pieces must be short for a fit that starts off their frequencies."""
BEGINNING_S = 40.0
BEGINNING_ROUNDS = 5


def segments_for(rig: TwinRig, values: EffectValues, observations: Observations) -> list[int]:
    """First samples of the pieces that a model is fitted over; a low-pass remembers the piece before, so it gets one piece."""
    if is_wide(observations):
        return pieces_of(rig, observations)
    if "lowpass_lag" in values:
        return [0]
    return segments_of(observations, TWO_MODES_SEGMENT_S if "double_pendulum" in values else SEGMENT_S)


@dataclass(frozen=True, slots=True)
class Setting:
    """The rig, what its model has already, the recording, and who is told of progress."""

    rig: TwinRig
    believed: EffectValues
    log: Observations
    tick: Callable[[], None]

    @property
    def wide(self) -> bool:
        """The recording is of a swing that only the right model can follow as one motion."""
        return is_wide(self.log)

    def simulator(self, names: frozenset[str] | tuple[str, ...]) -> Simulator:
        """Of the believed effects and these."""
        return Simulator(self.rig, sorted({*self.believed, *names}))

    def fit(
        self, values: EffectValues, starts: Array | None = None, rounds: int = SEARCH_ROUNDS, beyond: float = np.inf
    ) -> Fit:
        """Fit initial motion and all effects in `values`, from there; believed effects keep their values."""
        simulator = self.simulator(tuple(values))
        at = simulator.values([], {**self.believed, **values})[simulator.starts :]
        free, firsts = self.free(simulator, values), segments_for(self.rig, values, self.log)
        if starts is None or starts.shape != (len(firsts), simulator.starts):
            starts = local_starts(simulator, self.log, at, firsts)
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
        if "double_pendulum" not in simulator.effect_names:
            return fit_motion(simulator, observations, starts, at, free, firsts, rounds, self.tick, beyond)
        modes = ByModes(self.rig, simulator.effect_names)
        at_mode = modes.by_mode(at)
        with np.errstate(over="ignore", invalid="ignore"):  # no step to a motion that runs away is taken
            fit = fit_motion(modes, observations, starts, at_mode, free, firsts, rounds, self.tick, beyond)
            return modes.fit_by_mass(fit)

    def starts(self, values: EffectValues) -> Array:
        """Starts piece by piece under a model, to fit its neighbours from."""
        simulator = self.simulator(tuple(values))
        at = simulator.values([], {**self.believed, **values})[simulator.starts :]
        return local_starts(simulator, self.log, at, segments_for(self.rig, values, self.log))

    def best_rigging(self, tried: Sequence[EffectValues]) -> EffectValues:
        """Of several rigging lengths, and the one that they point to, the best in a fit of the beginning that holds it.

        As it came out. Rigging and hook make up for each other in a narrow valley; this walks along it in steps.
        """
        beginning = piece(self.log, 0, int(np.searchsorted(self.log.time_s, BEGINNING_S)))
        simulator = self.simulator(tuple(tried[0]))
        firsts = segments_for(self.rig, tried[0], beginning)
        rigging = [slot.label for slot in simulator.parameters].index("double_pendulum.rigging_length_m")
        free = self.free(simulator, tried[0])
        free[rigging] = False

        def fitted(values: EffectValues) -> list[Fit]:
            at = simulator.values([], {**self.believed, **values})[simulator.starts :]
            try:
                starts = local_starts(simulator, beginning, at, firsts)
                fit = self._fitted(simulator, beginning, starts, at, free, firsts, BEGINNING_ROUNDS)
            except UNFOLLOWED:
                return []  # the fit ran to parameters that no integration can follow
            return [fit] if np.isfinite(fit.chi2) else []

        fits = [fit for values in tried for fit in fitted(values)]
        if not fits:
            return tried[0]
        between = _lowest(np.log([fit.values[rigging] for fit in fits]), np.array([fit.chi2 for fit in fits]))
        if between is not None:
            modes = ByModes(self.rig, simulator.effect_names)
            by_mode = modes.by_mode(min(fits, key=lambda each: each.chi2).values)
            by_mode[rigging] = np.exp(between)
            found = simulator.effects(modes.by_mass(by_mode))
            fits += fitted({name: found[name] for name in tried[0]})
        best = simulator.effects(min(fits, key=lambda each: each.chi2).values)
        return {name: best[name] for name in tried[0]}

    def free(self, simulator: Simulator, values: EffectValues) -> NDArray[np.bool_]:
        """The initial motion but for the heading, the phases, and the parameters of effects that are not believed."""
        free = np.array([slot.refitted or slot.effect in values for slot in simulator.parameters])
        free[HEADING] = False
        for i, slot in enumerate(simulator.parameters):
            sharp = values.get(slot.effect, {}).get("rising_share") == SHARPEST
            free[i] &= not (
                sharp and slot.parameter == "rising_share"
            )  # sharp edges stay: their place decides, not their form
        return free


def _lowest(at: Array, chi2: Array) -> float | None:
    """Where the parabola through the least of rising places and its neighbours is lowest; None at an end."""
    k = int(np.argmin(chi2))
    if not 0 < k < len(at) - 1:
        return None
    slopes, middles = np.diff(chi2[k - 1 : k + 2]) / np.diff(at[k - 1 : k + 2]), (at[k - 1 : k + 1] + at[k : k + 2]) / 2
    return float(middles[0] - slopes[0] * (middles[1] - middles[0]) / (slopes[1] - slopes[0]))
