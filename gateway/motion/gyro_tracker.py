"""A second motion tracker that also takes the rates of a gyroscope; it counts while the one without agrees with it."""

import numpy as np
from numpy.typing import NDArray

from gateway.motion.estimate import MotionEstimate
from gateway.motion.gyro_check import GyroCheck
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.motion_tracker import MotionTracker
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
        return MotionTracker(self._rig, mount_u_rad=self._mount_u_rad, noise_g=self._noise_g, gyro=self._gyro)
