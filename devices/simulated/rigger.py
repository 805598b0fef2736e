"""The simulated rigger: takes the housing off the rope, turns it to the faces that a recalibration asks for, and lays it down.

A housing that lies on a bench shows gravity alone. It is laid down a tenth of a degree beside the face, as against a square.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN_S = 2.0
"""Time in which the housing is turned to another face. Basis: a choice; what a person takes."""
PLACEMENT_RAD = np.radians(0.08)
"""Standard deviation of the attitude in which the housing is laid down, about each axis across the vertical. Basis: a choice; a
machined housing on a table, within the 0.1 degrees of `MAX_TYPE_A_G`."""
SHAKE_G = 0.05
"""Standard deviation of the readings by the hand that turns the housing. Basis: twice the limit of a still window, so that it
counts as motion."""
UPRIGHT = np.array([0.0, 0.0, 1.0])
"""Definition: a unit vector."""


class Rigger:
    """Holds the attitude of the housing, as the direction that points up in its own axes."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._from, self._to, self._start_s = UPRIGHT, UPRIGHT, -TURN_S

    def turn(self, up: Array, time_s: float) -> None:
        """Begin to turn the housing at a time, so that a direction (3,), a unit vector, points up."""
        self._from = self._up(np.array([time_s]))[0]
        self._to = _unit(up + np.cross(self._random.normal(0.0, PLACEMENT_RAD, 3), up))
        self._start_s = time_s

    def specific_force_g(self, time_s: Array) -> Array:
        """Return the specific force in the housing's axes, shape (n, 3), at times (n,) after the last turn."""
        turning = (time_s < self._start_s + TURN_S)[:, None]
        return self._up(time_s) + SHAKE_G * turning * self._random.standard_normal((len(time_s), 3))

    def _up(self, time_s: Array) -> Array:
        """Return the direction that points up, shape (n, 3), on the great circle between the two faces."""
        across = self._to - np.dot(self._to, self._from) * self._from
        if np.linalg.norm(across) < 1e-6:  # the same face, or the opposite one by way of any other
            across = np.cross(self._from, np.roll(np.eye(3)[np.argmax(np.abs(self._from))], 1))
        angle_rad = np.arccos(np.clip(np.dot(self._to, self._from), -1.0, 1.0))
        share = np.clip((time_s - self._start_s) / TURN_S, 0.0, 1.0)
        turned_rad = (angle_rad * share * share * (3 - 2 * share))[:, None]
        up: Array = np.cos(turned_rad) * self._from + np.sin(turned_rad) * _unit(across)
        return up


def _unit(vector: Array) -> Array:
    result: Array = vector / np.linalg.norm(vector)
    return result
