"""Smooth ramps in time: the polynomial of fifth degree with zero first and second derivative at both ends."""

from dataclasses import dataclass

import numpy as np

from tests.blind.mechanics import Array


def rise(part: Array) -> Array:
    """Return the ramp from 0 to 1 over 0 <= part <= 1; it is constant outside."""
    s = np.clip(part, 0.0, 1.0)
    raised: Array = s**3 * (10 + s * (6 * s - 15))
    return raised


def bell(part: Array) -> Array:
    """Return the ramp's derivative: area 1, peak 15/8."""
    s = np.clip(part, 0.0, 1.0)
    return 30 * (s * (1 - s)) ** 2


def bell_slope(part: Array) -> Array:
    """Return the ramp's second derivative."""
    s = np.clip(part, 0.0, 1.0)
    return 60 * s * (1 - s) * (1 - 2 * s)


def travel(part: Array) -> Array:
    """Return the ramp's integral."""
    s = np.clip(part, 0.0, 1.0)
    return s**4 * (2.5 + s * (s - 3)) + np.maximum(part - 1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """A motion that reaches a speed by one ramp, holds it, and stops by another."""

    start_s: float
    ramp_s: float
    hold_s: float
    speed: float

    @property
    def end_s(self) -> float:
        """The end of the second ramp."""
        return self.start_s + 2 * self.ramp_s + self.hold_s

    def acceleration(self, time_s: Array) -> Array:
        """Return the second derivative of the displacement."""
        up, down = self._parts(time_s)
        return self.speed / self.ramp_s * (bell(up) - bell(down))

    def velocity(self, time_s: Array) -> Array:
        """Return the first derivative of the displacement."""
        up, down = self._parts(time_s)
        return self.speed * (rise(up) - rise(down))

    def displacement(self, time_s: Array) -> Array:
        """Return the way since the start."""
        up, down = self._parts(time_s)
        return self.speed * self.ramp_s * (travel(up) - travel(down))

    def _parts(self, time_s: Array) -> tuple[Array, Array]:
        up = (time_s - self.start_s) / self.ramp_s
        return up, up - 1 - self.hold_s / self.ramp_s
