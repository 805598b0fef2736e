"""What is stated of the crane and counts again and again: speeds and a length as observations, constants by their return.

Without that, a misfit of the equations would drive them away for good, and everything would become certain for ever.
"""

import math

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.mixture import Mixture
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    HOIST_SPEED,
    LEVER,
    LN_LENGTH,
    MOUNT,
    OFFSET,
    PIVOT_VELOCITY,
    PLACE,
    SIDE_FORCE,
    STIFFNESS,
    indices,
)
from gateway.numerics.array import Array

RETURN_TIMES_S = (
    (OFFSET, 1e4),
    (MOUNT, 1e4),
    (AXIAL_OFFSET, 1e4),
    (PLACE, 3e3),
    (LEVER, 3e3),
    (STIFFNESS, 3e3),
    (SIDE_FORCE, 600.0),
)
"""Constants, and the time in which each returns to what was stated. Basis: 2 mg in ten minutes of a warming sensor, clamps that
slip, winds that turn."""
RETURN_EVERY_S = 4.0
"""Time between two such returns. Basis: short against all of them."""
PIVOT_SPEED_M_S, PIVOT_SPEED_TIME_S = 1.5, 20.0
"""Standard deviation of the pivot's speed, and the time for which it counts as one observation. Basis: cranes drive at up to
4 m/s."""
LN_LENGTH_SIGMA, LN_LENGTH_TIME_S = 0.5, 30.0
"""The same of the logarithm of the rope's length against what was stated: hoists change it, but not to anything."""
HOIST_SPEED_M_S, HOIST_SPEED_TIME_S = 0.5, 25.0
"""The same of the speed of a winch that runs. Basis: cranes hoist at up to 1.2 m/s."""
OBSERVED = [*indices(PIVOT_VELOCITY), LN_LENGTH, HOIST_SPEED]
"""States of which something is stated as an observation."""
N_STATED = len(OBSERVED)
"""Definition."""
CONSTANTS = [place for states, _ in RETURN_TIMES_S for place in indices(states)]
"""States that return to what was stated."""


class StatedValues:
    """The stated values of one crane: speeds are zero, the rest is as before the first reading."""

    def __init__(self, prior: Mixture) -> None:
        self._state, self._variance = prior.state[0], np.diagonal(prior.covariance[0])
        self._expected = np.zeros(N_STATED)
        self._expected[OBSERVED.index(LN_LENGTH)] = self._state[LN_LENGTH]
        self.jacobian = np.eye(len(self._state))[OBSERVED]
        """Of the observations by the state, shape (N_STATED, n)."""

    def innovation(self, x: Array) -> Array:
        """Return what is stated less the states, shape (m, N_STATED)."""
        found: Array = self._expected - x[:, OBSERVED]
        return found

    def noise(self, time_s: float) -> Array:
        """Return the variances of the observations for a step of this time, shape (m, N_STATED)."""
        found = np.empty((N_HYPOTHESES, N_STATED))
        found[:, :2] = PIVOT_SPEED_M_S**2 * PIVOT_SPEED_TIME_S / time_s
        found[:, 2] = LN_LENGTH_SIGMA**2 * LN_LENGTH_TIME_S / time_s
        found[:, 3] = HOIST_SPEED_M_S**2 * HOIST_SPEED_TIME_S / time_s
        return found

    def draw_back(self, x: Array, covariance: Array, time_s: float) -> Array:
        """Let the constants return towards what was stated, in place; return the factors of all states, shape (n,)."""
        factor = np.ones(x.shape[1])
        for states, return_s in RETURN_TIMES_S:
            factor[states] = math.exp(-time_s / return_s)
        x *= factor
        x += (1 - factor) * self._state
        covariance *= np.multiply.outer(factor, factor)
        covariance.reshape(len(x), -1)[:, :: x.shape[1] + 1] += np.where(
            factor < 1, self._variance * (1 - factor**2), 0.0
        )
        return factor
