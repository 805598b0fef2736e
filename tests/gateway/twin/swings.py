"""A rig and quantities of a prediction that the tests of the twin share."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
G = 9.80665
LENGTH_M, POSITION_M = 12.0, 5.0
SWING_RATE = np.sqrt(G / LENGTH_M)
PERIOD_S = 2 * np.pi / SWING_RATE
RIG = TwinRig(length_m=LENGTH_M, position_m=POSITION_M)


def at_pivot(length_m: float = LENGTH_M) -> TwinRig:
    """Return a rig with the housing at the pivot: its specific force is gravity alone and gives its attitude."""
    return TwinRig(length_m=length_m, position_m=0.0)


def predicted(
    rig: TwinRig,
    effects: EffectValues,
    start: Sequence[float] | Array,
    time_s: Array,
    temperature_c: Array | None = None,
) -> Array:
    """Return the readings that the twin predicts."""
    simulator = Simulator(rig, tuple(effects))
    return simulator.predict(simulator.values(start, effects), time_s, temperature_c)


def rope_angle(force_g: Array) -> Array:
    """Return the rope's angle from the readings at a pivot that is at rest."""
    angle: Array = np.arctan2(np.hypot(force_g[:, 0], force_g[:, 1]), force_g[:, 2])
    return angle


def peaks(time_s: Array, signal: Array) -> tuple[Array, Array]:
    """Return times and heights of the maxima, by parabolas through three samples."""
    middle = np.flatnonzero((signal[1:-1] > signal[:-2]) & (signal[1:-1] >= signal[2:])) + 1
    before, at, after = signal[middle - 1], signal[middle], signal[middle + 1]
    shift = 0.5 * (before - after) / (before - 2 * at + after)
    return time_s[middle] + shift * (time_s[1] - time_s[0]), at - 0.25 * (before - after) * shift
