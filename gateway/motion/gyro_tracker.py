"""A second motion tracker that also takes the rates of a gyroscope; it counts while the one without agrees with it."""

import numpy as np
from numpy.typing import NDArray

from gateway.motion.estimate import MotionEstimate
from gateway.motion.gyro_check import GyroCheck
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.length_check import LengthCheckedTracker
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing

KNOWN_BIAS_RAD_S = np.radians(0.5)
"""Standard uncertainty of the gyroscope's bias up to which its rates say whether the housing turns."""


class GyroTracker:
    """Feeds a tracker with acceleration and rates."""

    def __init__(self, rig: MountedHousing, mount_u_rad: float, noise_g: float | None, gyro: GyroPrior) -> None:
        self._rig, self._mount_u_rad, self._noise_g, self._gyro = rig, mount_u_rad, noise_g, gyro
        self.check = GyroCheck()
        self.tracker = self._new_tracker()

    def update(self, time_s: Array, force_g: Array, is_clipped: NDArray[np.bool_] | None, rate_rad_s: Array) -> None:
        """Take a block of specific force and angular rate in the housing frame, shapes (n,), (n, 3), (n,) and (n, 3)."""
        self.check.add_rates(time_s, rate_rad_s)
        self.tracker.update(time_s, force_g, is_clipped, rate_rad_s)

    def choose(
        self, plain: MotionEstimate, plain_evidence: float, now_s: float, free_swing_length_m: float | None
    ) -> MotionEstimate:
        """Return the motion with the gyroscope where it may be believed, or else the given one without.

        `plain_evidence`: log evidence of the newest forces without it.
        """
        sharpened = self.tracker.estimate(now_s, free_swing_length_m)
        if self.check.compare(self.tracker.force_evidence - plain_evidence, self.tracker.rate_squared):
            self.tracker = self._new_tracker()
            return plain
        return sharpened if self.check.is_used and sharpened.angle_rad is not None else plain

    def bias_rad_s(self) -> Array | None:
        """Return the reading of the gyroscope at rest, shape (3,); None where it is not known, or the gyroscope left out."""
        found = self.tracker.gyro_bias() if self.check.is_used else None
        return None if found is None or found[1].max() > KNOWN_BIAS_RAD_S else found[0]

    def _new_tracker(self) -> LengthCheckedTracker:
        return LengthCheckedTracker(self._rig, mount_u_rad=self._mount_u_rad, noise_g=self._noise_g, gyro=self._gyro)
