"""Commanded motions: trapezoids of speed with limited jerk, whose last part may be cut by a brake."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from tests.blind.mechanics import Array

BRAKE_S = 0.06
"""In which a brake stops the creep speed, before the jerk is limited."""


@dataclass(frozen=True, slots=True)
class Move:
    """A speed reached by a ramp, held, and left by a ramp that a brake cuts short."""

    axis: str
    """`x`, `y` m/s; `slew`, `luff` rad/s; `trolley` m/s outward; `hoist` m/s, positive when lowering."""
    start_s: float
    speed: float
    ramp_s: float
    hold_s: float
    brake: float = 0.0
    """Share of the speed at which the brake closes."""

    @property
    def end_s(self) -> float:
        return self.start_s + 2 * self.ramp_s + self.hold_s

    @property
    def way(self) -> float:
        """Displacement at the end."""
        creep_s = self.brake * self.ramp_s
        return self.speed * (self.ramp_s + self.hold_s - self.brake * (creep_s - BRAKE_S) / 2)

    def velocity(self, time_s: Array) -> Array:
        """Return the speed before the jerk is limited."""
        slow_s = self.ramp_s + self.hold_s + (1 - self.brake) * self.ramp_s
        stop_s = slow_s + (BRAKE_S if self.brake else 0.0) + 1e-9
        corners_s = [0.0, self.ramp_s, self.ramp_s + self.hold_s, slow_s, stop_s]
        shape = np.interp(time_s - self.start_s, corners_s, [0.0, 1.0, 1.0, self.brake, 0.0], left=0.0, right=0.0)
        return np.asarray(self.speed * shape)

    def as_json(self) -> dict[str, Any]:
        """Return the move as `case.json` states it."""
        return {
            "drive": self.axis,
            "start_s": round(self.start_s, 2),
            "speed": round(self.speed, 4),
            "ramp_s": round(self.ramp_s, 2),
            "hold_s": round(self.hold_s, 2),
            "brake": self.brake,
        }


@dataclass(frozen=True)
class Moves:
    """All moves of a recording, on the half steps of the engine."""

    time_s: Array
    moves: tuple[Move, ...]
    jerk_s: float
    """A step of acceleration takes twice this time."""
    walk: float = 0.0
    """Sideways motion of the pivot along y per length of rope paid out."""

    @property
    def half_step_s(self) -> float:
        return float(self.time_s[1] - self.time_s[0])

    def velocity(self, axis: str) -> Array:
        """Return m/s or rad/s at the half steps."""
        total = sum(
            (move.velocity(self.time_s) for move in self.moves if move.axis == axis), np.zeros(len(self.time_s))
        )
        width = max(1, round(self.jerk_s / self.half_step_s))
        smooth: Array = uniform_filter1d(uniform_filter1d(total, width), width)
        return smooth + self.walk * self.velocity("hoist") if axis == "y" and self.walk else smooth

    def acceleration(self, axis: str) -> Array:
        """Return m/s^2 or rad/s^2 at the half steps."""
        return np.gradient(self.velocity(axis), self.half_step_s)

    def displacement(self, axis: str) -> Array:
        """Return m or rad since the beginning, at the half steps."""
        velocity = self.velocity(axis)
        way = np.cumsum((velocity[1:] + velocity[:-1]) / 2) * self.half_step_s
        return np.concatenate([[0.0], way])

    @cached_property
    def paid_out_m(self) -> Array:
        return self.displacement("hoist")


def scaled(moves: Sequence[Move], factor: float, axes: tuple[str, ...]) -> tuple[Move, ...]:
    """Return the moves of these axes at another speed, the others as they are."""
    return tuple(
        Move(m.axis, m.start_s, m.speed * (factor if m.axis in axes else 1.0), m.ramp_s, m.hold_s, m.brake)
        for m in moves
    )
