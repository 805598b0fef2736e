"""A second motion tracker that also takes the rates of a gyroscope; it counts while the one without agrees with it.

A wrong gyroscope (dead, mounted otherwise, of another scale) spoils the filter that it feeds: its rates may fit then, but the
forces fit worse than in the filter that has never seen them. Where both angles differ and the forces fit, the rates decide.
"""

import numpy as np
from numpy.typing import NDArray

from gateway.messages.header import Reason
from gateway.motion.estimate import MotionEstimate
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.motion_tracker import MotionTracker
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing

CONTRADICTS = Reason("gyro_left_out", "the gyroscope is left out: its rates contradict the accelerometer")
SILENT = Reason("gyro_left_out", "the gyroscope is left out: its rates do not change at all")
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
    def fault(self) -> Reason | None:
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


KNOWN_BIAS_RAD_S = np.radians(0.5)
"""Standard uncertainty of the gyroscope's bias up to which its rates say whether the housing turns."""


class GyroTracker:
    """Feeds a tracker with acceleration and rates."""

    def __init__(
        self,
        rig: MountedHousing,
        mount_u_rad: float,
        noise_g: float | None,
        gyro: GyroPrior,
        *,
        keeps_steps: bool = False,
    ) -> None:
        self._rig, self._mount_u_rad, self._noise_g, self._gyro = rig, mount_u_rad, noise_g, gyro
        self._keeps_steps = keeps_steps
        self.check = GyroCheck()
        self.tracker = self._new_tracker()

    def update(
        self,
        time_s: Array,
        force_g: Array,
        is_clipped: NDArray[np.bool_] | None,
        rate_rad_s: Array,
        plain: MotionTracker,
    ) -> None:
        """Take a block of specific force and angular rate in the housing frame, shapes (n,), (n, 3), (n,) and (n, 3).

        `plain`: the tracker of the same block without the rates, against which this one is held.
        """
        self.check.add_rates(time_s, rate_rad_s)
        self.tracker.update(time_s, force_g, is_clipped, rate_rad_s)
        if self.check.compare(self.tracker.force_evidence - plain.force_evidence, self.tracker.rate_squared):
            self.tracker = self._new_tracker()

    def choose(self, plain: MotionEstimate, now_s: float) -> MotionEstimate:
        """Return the motion with the gyroscope where it may be believed, or else the given one without."""
        if not self.check.is_used:
            return plain
        sharpened = self.tracker.estimate(now_s)
        return plain if sharpened.angle_rad is None else sharpened

    def bias_rad_s(self) -> Array | None:
        """Return the reading of the gyroscope at rest, shape (3,); None where it is not known, or the gyroscope left out."""
        found = self.tracker.gyro_bias() if self.check.is_used else None
        return None if found is None or found[1].max() > KNOWN_BIAS_RAD_S else found[0]

    def _new_tracker(self) -> MotionTracker:
        return MotionTracker(
            self._rig,
            mount_u_rad=self._mount_u_rad,
            noise_g=self._noise_g,
            gyro=self._gyro,
            keeps_steps=self._keeps_steps,
        )
