"""The hypotheses on what acts on crane and load, and how one follows another.

Each hypothesis joins one of three inputs (none: the load swings freely or rests; the pivot accelerates; a gust pushes the load)
with one of two ropes (constant length; hoisting). An acceleration of the pivot and a gust are Gaussian processes with the
covariance Matérn 3/2, that is, a critically damped second-order process (Hartikainen and Särkkä 2010, eq. 12).
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from gateway.motion.state_vector import (
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    N_STATES,
)
from gateway.numerics.array import Array

N_INPUTS = 3
"""Definition: none, pivot, gust."""


class MotionHypothesis(IntEnum):
    """What acts: place in the weights of the filter."""

    FREE = 0
    DRIVEN = 1
    GUST = 2
    FREE_HOISTING = 3
    DRIVEN_HOISTING = 4
    GUST_HOISTING = 5


N_HYPOTHESES = len(MotionHypothesis)
IS_DRIVEN = np.array([h % N_INPUTS == 1 for h in MotionHypothesis])
IS_GUST = np.array([h % N_INPUTS == 2 for h in MotionHypothesis])
IS_HOISTING = np.array([h >= N_INPUTS for h in MotionHypothesis])
PIVOT_SIGN = IS_DRIVEN.astype(float)
"""1 where the input is an acceleration of the pivot."""
LOAD_SIGN = IS_GUST.astype(float) - PIVOT_SIGN
"""Sign with which the input acts on the load's swing: an acceleration of the pivot acts like a force against it."""
_KINDS = np.column_stack([IS_DRIVEN, IS_GUST, IS_HOISTING]).astype(float)
INITIAL_WEIGHTS = np.array([0.75, 0.10, 0.05, 0.06, 0.03, 0.01])
"""Basis: a gateway is switched on more often while the crane rests than while it works; any of them is overruled in seconds."""

PIVOT_RATE_1_S, PIVOT_SIGMA = 0.6, 0.03
"""Rate and standard deviation of the pivot's acceleration over g. Basis: ramps of 2 to 9 s to 0.2 to 2.5 m/s."""
GUST_RATE_1_S, GUST_SIGMA = 0.35, 0.006
"""Rate and standard deviation of a gust's force per weight. Basis: gusts of 5 to 17 s with up to 0.11 m/s^2."""
HOIST_JERK = 0.08
"""Root of the noise density of the hoist's acceleration, m/s^2/sqrt(s). Basis: 0.5 m/s reached in a second."""

DRIVE_START_1_S, GUST_START_1_S, HOIST_START_1_S = 1 / 25, 1 / 90, 1 / 60
"""How often each begins. Basis: a crane at work moves twice a minute; a factor of three changes the onset by one update."""
ABRUPT_1_S = 1 / 1000
"""How often a drive or hoist begins, changes or ends within one update, as by a brake or a stepped controller."""
JUMP_1_S = 3e-5
"""How often a drive changes abruptly while it lasts. Basis: it would explain anything."""
DRIVE_END_1_S, GUST_END_1_S, HOIST_END_1_S = 1.0, 0.5, 1.0
"""How fast the end of each is believed once its input has become zero within the tolerances below."""

PIVOT_TOLERANCE, PIVOT_RATE_TOLERANCE_1_S = 3e-4, 2e-3
GUST_TOLERANCE, GUST_RATE_TOLERANCE_1_S = 3e-4, 5e-4
HOIST_TOLERANCE_M_S, HOIST_TOLERANCE_M_S2 = 0.01, 0.03
"""Standard deviations with which a drive, a gust and a hoist end smoothly, not at exactly zero."""


_INPUT_STATES = [*range(INPUT.start, INPUT.stop), *range(INPUT_RATE.start, INPUT_RATE.stop)]
_HOIST_STATES = [HOIST_SPEED, HOIST_ACCELERATION]


def _variance(states: list[int], sigmas: list[float]) -> Array:
    variance = np.zeros(N_STATES)
    variance[states] = np.square(sigmas)
    return variance


@dataclass(frozen=True, slots=True)
class Transition:
    """A possible change from one hypothesis to another within an update."""

    source: MotionHypothesis
    target: MotionHypothesis
    rate_1_s: float
    opened: Array
    """Variance that the change adds to the state, shape (N_STATES,)."""
    zeroed: tuple[int, ...] = ()
    """States that are zero after the change."""
    tolerance: tuple[float, ...] | None = None
    """The change happens where those states are already zero within these standard deviations; None: from any value."""
    counts_spread: bool = False
    """A state of which little is known is improbably zero: a hoist that may run at any speed has not ended."""


def probabilities(weight: Array) -> tuple[float, float, float]:
    """Return how probably the pivot accelerates, a gust pushes the load, and the rope's length changes."""
    driven, gust, hoisting = (weight @ _KINDS).tolist()
    return driven, gust, hoisting


def transitions() -> tuple[Transition, ...]:
    """Return all transitions between different hypotheses, and the jumps within one."""
    nothing = np.zeros(N_STATES)
    soft_drive = _variance(_INPUT_STATES, [5e-4, 5e-4, 1e-2, 1e-2])
    hard_drive = _variance(_INPUT_STATES, [PIVOT_SIGMA] * 2 + [PIVOT_SIGMA] * 2)
    soft_gust = _variance(_INPUT_STATES, [2e-4, 2e-4, 2e-3, 2e-3])
    soft_hoist, hard_hoist = _variance(_HOIST_STATES, [0.005, 0.05]), _variance(_HOIST_STATES, [0.05, 1.0])
    inputs, hoist = tuple(_INPUT_STATES), tuple(_HOIST_STATES)
    pivot_ends = (PIVOT_TOLERANCE,) * 2 + (PIVOT_RATE_TOLERANCE_1_S,) * 2
    gust_ends = (GUST_TOLERANCE,) * 2 + (GUST_RATE_TOLERANCE_1_S,) * 2
    hoist_ends = (HOIST_TOLERANCE_M_S, HOIST_TOLERANCE_M_S2)
    found: list[Transition] = []
    for first in (MotionHypothesis.FREE, MotionHypothesis.FREE_HOISTING):
        driven, gust = MotionHypothesis(first + 1), MotionHypothesis(first + 2)
        found += [
            Transition(first, driven, DRIVE_START_1_S, soft_drive),
            Transition(first, driven, ABRUPT_1_S, hard_drive),
            Transition(
                first,
                gust,
                GUST_START_1_S,
                soft_gust,
            ),
            Transition(driven, driven, JUMP_1_S, hard_drive),
            Transition(driven, first, DRIVE_END_1_S, nothing, inputs, pivot_ends),
            Transition(driven, first, ABRUPT_1_S, nothing, inputs),
            Transition(gust, first, GUST_END_1_S, nothing, inputs, gust_ends),
        ]
    for still in (MotionHypothesis.FREE, MotionHypothesis.DRIVEN, MotionHypothesis.GUST):
        hoisting = MotionHypothesis(still + N_INPUTS)
        found += [
            Transition(still, hoisting, HOIST_START_1_S, soft_hoist),
            Transition(still, hoisting, ABRUPT_1_S, hard_hoist),
            Transition(hoisting, hoisting, ABRUPT_1_S, hard_hoist),
            Transition(hoisting, still, HOIST_END_1_S, nothing, hoist, hoist_ends, counts_spread=True),
        ]
    return tuple(found)
