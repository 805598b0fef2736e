"""Whether the motion that includes a gyroscope may be believed: it is held against the motion by the accelerometer alone.

A wrong gyroscope (dead, mounted otherwise, of another scale) spoils the filter that it feeds: its rates may fit then, but the
forces fit worse than in the filter that has never seen them. Where both angles differ and the forces fit, the rates decide.
"""

import numpy as np

from gateway.numerics.array import Array

CONTRADICTS = "the gyroscope is left out: its rates contradict the accelerometer"
SILENT = "the gyroscope is left out: its rates do not change at all"
LEAST_EVIDENCE = -8.0
"""Log evidence of the forces with the gyroscope less that without it below which the gyroscope is left out. Basis: odds of
1e10 before tempering."""
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

    def compare(self, evidence_gain: float, innovation_squared: float) -> bool:
        """Return whether the gyroscope contradicts the accelerometer.

        `evidence_gain`: log evidence of the newest forces with the gyroscope less that without it; `innovation_squared`: mean of
        the normalised innovation squared of the rates.
        """
        if evidence_gain > LEAST_EVIDENCE and innovation_squared < LARGEST_INNOVATION:
            return False
        self._has_contradicted = True
        self._use_from_s = self._newest_s + LEFT_OUT_S
        return True

    @property
    def _is_silent(self) -> bool:
        return self._constant is not None and self._newest_s - self._constant[0] >= SILENT_S
