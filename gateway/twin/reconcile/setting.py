"""What stays the same while models are tried."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.pulse import SHARPEST
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.nuisances import local_starts
from gateway.twin.reconcile.observations import Observations, piece
from gateway.twin.reconcile.pieces import fit_motion, is_wide, pieces_of
from gateway.twin.reconcile.shooting import HEADING, SEGMENT_S, Fit, segments_of
from gateway.twin.simulator import Simulator

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
        return fit_motion(simulator, self.log, starts, at, free, firsts, rounds, self.tick, beyond)

    def starts(self, values: EffectValues) -> Array:
        """Starts piece by piece under a model, to fit its neighbours from."""
        simulator = self.simulator(tuple(values))
        at = simulator.values([], {**self.believed, **values})[simulator.starts :]
        return local_starts(simulator, self.log, at, segments_for(self.rig, values, self.log))

    def best_beginning(self, tried: Sequence[EffectValues], held: str) -> EffectValues:
        """Of several values those from which a fit of the beginning, with one value held, comes out best; as they came out.

        Where one parameter makes up for another in a narrow, curved valley, this walks along it in steps.
        """
        beginning = piece(self.log, 0, int(np.searchsorted(self.log.time_s, BEGINNING_S)))
        simulator = self.simulator(tuple(tried[0]))
        firsts = segments_for(self.rig, tried[0], beginning)
        free = self.free(simulator, tried[0]) & np.array([slot.label != held for slot in simulator.parameters])
        fits = []
        for values in tried:
            at = simulator.values([], {**self.believed, **values})[simulator.starts :]
            starts = local_starts(simulator, beginning, at, firsts)
            fits.append(fit_motion(simulator, beginning, starts, at, free, firsts, BEGINNING_ROUNDS, self.tick))
        fit = min(fits, key=lambda each: each.chi2)
        found = simulator.effects(fit.values)
        return {name: found[name] for name in tried[0]}

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
