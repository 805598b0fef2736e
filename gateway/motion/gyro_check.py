"""Whether the motion that includes a gyroscope may be believed: it is held against the motion by the accelerometer alone.

A wrong gyroscope (dead, mounted otherwise, of another scale) spoils the filter that it feeds, whose own innovations then need not
show it. The other filter has never seen it.
"""

import cmath

import numpy as np

from gateway.motion.estimate import MotionEstimate
from gateway.numerics.array import Array

CONTRADICTS = "the gyroscope is left out: its rates contradict the accelerometer"
SILENT = "the gyroscope is left out: its rates do not change at all"
MEMORY = 0.8
"""Weight of the earlier disagreement in its mean, at ten updates a second: half a second."""
LARGEST_DISAGREEMENT = 9.0
"""Mean square of the difference of both angles over its variance from which on the gyroscope is left out: three sigma."""
LARGEST_INNOVATION = 12.0
"""Mean of the normalised innovation squared of the rates from which on it is left out. Definition: 3 is expected."""
PROBATION_S, LEFT_OUT_S = 10.0, 30.0
"""Time without a contradiction before the gyroscope is used: at first, and after one."""
SILENT_S = 3.0
"""Time for which all three rates must be exactly constant to be no measurement. Basis: the noise of some steps."""


class GyroCheck:
    """Compares both motions."""

    def __init__(self) -> None:
        self._use_from_s: float | None = None
        self._newest_s = 0.0
        self._disagreement = 0.0
        self._constant: tuple[float, Array] | None = None
        """Since when the rates have been those."""
        self._has_contradicted = False

    @property
    def is_used(self) -> bool:
        """Whether the motion with the gyroscope may be believed."""
        return self._use_from_s is not None and self._newest_s >= self._use_from_s and not self._is_silent

    @property
    def fault(self) -> str | None:
        """Why the gyroscope is left out; None: nothing is known to be wrong with it."""
        if self._is_silent:
            return SILENT
        return CONTRADICTS if self._has_contradicted and not self.is_used else None

    def add_rates(self, time_s: Array, rate_rad_s: Array) -> None:
        """Take the rates of a block, shapes (n,) and (n, 3)."""
        self._newest_s = float(time_s[-1])
        if self._use_from_s is None:
            self._use_from_s = self._newest_s + PROBATION_S
        last = rate_rad_s[-1]
        if self._constant is None or not np.all(rate_rad_s == self._constant[1]):
            self._constant = (self._newest_s, last)

    def compare(self, plain: MotionEstimate, sharpened: MotionEstimate, innovation_squared: float) -> bool:
        """Take both motions at one time; return whether they contradict each other.

        `innovation_squared`: mean of the normalised innovation squared of the rates.
        """
        self._disagreement = MEMORY * self._disagreement + (1 - MEMORY) * _disagreement(plain, sharpened)
        if self._disagreement < LARGEST_DISAGREEMENT and innovation_squared < LARGEST_INNOVATION:
            return False
        self._disagreement, self._has_contradicted = 0.0, True
        self._use_from_s = self._newest_s + LEFT_OUT_S
        return True

    @property
    def _is_silent(self) -> bool:
        return self._constant is not None and self._newest_s - self._constant[0] >= SILENT_S


def _disagreement(plain: MotionEstimate, sharpened: MotionEstimate) -> float:
    """Return the squared difference of both angles over its variance; 0 where one is not known."""
    first, other = _angle(plain), _angle(sharpened)
    if first is None or other is None or plain.u_rad is None or sharpened.u_rad is None:
        return 0.0
    return abs(first - other) ** 2 / (plain.u_rad**2 + sharpened.u_rad**2)


def _angle(estimate: MotionEstimate) -> complex | None:
    if estimate.angle_rad is None or estimate.azimuth_rad is None:
        return None
    return cmath.rect(estimate.angle_rad, estimate.azimuth_rad)
