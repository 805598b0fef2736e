"""A motion tracker whose account of a free swing is held against the swing's period.

A tracker that began with a wrong length of the rope may explain a free swing by a wind that moves with it. The period alone gives
the length then: a second tracker begins with it, and takes over when it sees the free swing.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.motion.estimate import MotionEstimate
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.hypotheses import MotionHypothesis
from gateway.motion.motion_tracker import MotionTracker
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing

LENGTH_BY_PERIOD_U_REL = 0.015
"""Relative standard uncertainty of a length by the period. Basis: a damped swing of 15 degrees in a window of one period."""
LENGTH_TOLERANCE = 0.02
"""Relative difference of two lengths that are the same."""
TRIAL_PERIODS, LONGEST_TRIAL_PERIODS, PAUSE_PERIODS = 0.75, 2.0, 3.0
"""A second tracker is judged after the first, given up after the second, and another one may follow after the third."""
FREE_PROBABILITY = 0.9
"""Probability of the free swing from which on the second tracker takes over."""


class LengthCheckedTracker:
    """A motion tracker, and at times a second one."""

    def __init__(
        self, rig: MountedHousing, *, mount_u_rad: float, noise_g: float | None, gyro: GyroPrior | None = None
    ) -> None:
        self._rig, self._mount_u_rad, self._noise_g, self._gyro = rig, mount_u_rad, noise_g, gyro
        self._tracker = self._new_tracker(rig)
        self._second: MotionTracker | None = None
        self._since_s = 0.0
        """Beginning of the second tracker, or of the pause after it."""
        self._pause_s = 0.0
        self._outliers_before = 0

    @property
    def outliers(self) -> int:
        """Bins that no hypothesis explained."""
        return self._outliers_before + self._tracker.outliers

    @property
    def rate_squared(self) -> float:
        """Mean of the normalised innovation squared of the gyroscope's readings; 3 is expected."""
        return self._tracker.rate_squared

    @property
    def force_evidence(self) -> float:
        """Log evidence of the accelerometer's newest readings, without those of a gyroscope."""
        return self._tracker.force_evidence

    def gyro_bias(self) -> tuple[Array, Array] | None:
        """Return the gyroscope's bias and its standard uncertainty, rad/s, shapes (3,); None without one."""
        return self._tracker.gyro_bias()

    def update(
        self, time_s: Array, force_g: Array, is_clipped: NDArray[np.bool_] | None, rate_rad_s: Array | None = None
    ) -> None:
        """Take a block of specific force and angular rate in the housing frame, shapes (n,), (n, 3) and (n, 3)."""
        self._tracker.update(time_s, force_g, is_clipped, rate_rad_s)
        if self._second is not None:
            self._second.update(time_s, force_g, is_clipped, rate_rad_s)

    def widen_gyro_bias(self, u_rad_s: float) -> None:
        """Add an unknown change of the gyroscope's bias, as by a temperature."""
        for tracker in (self._tracker, self._second):
            if tracker is not None:
                tracker.widen_gyro_bias(u_rad_s)

    def set_sensor(self, rig: MountedHousing, offset_u_g: Array, change_u_g: Array) -> None:
        """Set the same housing with other uncertainties of its sensor."""
        self._rig = rig
        for tracker in (self._tracker, self._second):
            if tracker is not None:
                tracker.set_offset_uncertainty(offset_u_g, change_u_g)

    def estimate(self, now_s: float, free_swing_length_m: float | None) -> MotionEstimate:
        """Return the motion; `free_swing_length_m`: length by the period of what looks like a free swing, None without one."""
        estimate = self._tracker.estimate(now_s)
        if self._second is None:
            if free_swing_length_m is not None and now_s >= self._since_s + self._pause_s:
                self._begin_where_doubtful(estimate, free_swing_length_m, now_s)
            return estimate
        other, trial_s = self._second.estimate(now_s), now_s - self._since_s
        if free_swing_length_m is None or trial_s > LONGEST_TRIAL_PERIODS * self._rig.small_swing_period_s:
            self._pause(now_s)
        elif trial_s > TRIAL_PERIODS * self._rig.small_swing_period_s and _sees_free_swing(other):
            self._outliers_before += self._tracker.outliers - self._second.outliers
            self._tracker = self._second
            self._pause(now_s)
            return other
        return estimate

    def _begin_where_doubtful(self, estimate: MotionEstimate, length_m: float, now_s: float) -> None:
        has_length = estimate.length_m is not None and abs(estimate.length_m / length_m - 1) < LENGTH_TOLERANCE
        if has_length and _sees_free_swing(estimate):
            return
        rig = replace(self._rig, length_m=length_m, length_u_rel=LENGTH_BY_PERIOD_U_REL)
        self._second, self._since_s = self._new_tracker(rig), now_s

    def _pause(self, now_s: float) -> None:
        self._second, self._since_s = None, now_s
        self._pause_s = PAUSE_PERIODS * self._rig.small_swing_period_s

    def _new_tracker(self, rig: MountedHousing) -> MotionTracker:
        return MotionTracker(rig, mount_u_rad=self._mount_u_rad, noise_g=self._noise_g, gyro=self._gyro)


def _sees_free_swing(estimate: MotionEstimate) -> bool:
    if estimate.angle_rad is None or not estimate.probabilities:
        return False
    return estimate.state in ("free", "rest") and estimate.probabilities[MotionHypothesis.FREE] > FREE_PROBABILITY
