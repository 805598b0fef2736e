"""The motion of a live stream with what makes it unknown: faults of the sensor, lasting clipping, too wide an interval."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.messages.header import Reason
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.motion.fault_detector import FaultDetector
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.gyro_tracker import GyroTracker
from gateway.motion.motion_tracker import MotionTracker
from gateway.numerics.array import Array
from gateway.swing.model.sensor_lowpass import delay_s
from gateway.swing.rig import MountedHousing

LONGEST_CLIPPING_S = 1.0
"""Time without an unclipped block after which the angle is no longer known."""
UNEXPLAINED_S = 2.0
"""Time in which outliers are counted. Basis: the window of a condition."""
MOST_OUTLIERS = 2
"""Bins that no hypothesis explains, in that time, from which on the motion is not explained. Basis: an impact spoils one bin; at
its edge it spoils two, and those two seconds are not explained."""

SHORTEST_DISTANCE = 0.03
"""Distance above the load, as a share of the rope's length, below which the transverse reading tells nothing of a swing."""
LARGEST_AXIAL_U_G = 3.8e-3
"""Standard uncertainty of the axial reading up to which it tells a swing there. Basis: a constant axial reading of 1 + b is an
offset or a steady circular swing of sqrt(2 b), here 5 degrees, from which on an angle counts as not known."""
UNCALIBRATED_AT_LOAD = Reason(
    "uncalibrated_at_load",
    "a sensor at the load sees a swing by its axial reading alone, and it is not calibrated well enough for that; "
    "calibrate it, or clamp the housing higher",
)
CONTRADICTION = Reason(
    "contradiction", "widened: x and y show another swing than z; the housing is not where stated, or a scale is wrong"
)


class MotionMonitor:
    """Feeds a motion tracker and a fault detector."""

    def __init__(
        self,
        rig: MountedHousing,
        *,
        mount_u_rad: float,
        noise_g: float | None = None,
        gyro: GyroPrior | None = None,
        keeps_steps: bool = False,
    ) -> None:
        """`mount_u_rad`: standard uncertainty of the housing's z axis against the rope; `noise_g`: stated, 1 sigma per sample.

        `gyro`: what is known of the gyroscope; None: there is none. `keeps_steps`: for a smoother.
        """
        self._rig, self._mount_u_rad, self._noise_g, self._gyro = rig.moving_with_load(), mount_u_rad, noise_g, gyro
        self._keeps_steps = keeps_steps
        self._warnings: tuple[Reason, ...] = ()
        self.restart()

    def restart(self) -> None:
        """Forget the past, as after the housing was off the rope."""
        self._new_trackers()
        self._faults = FaultDetector(self._rig)
        self._unclipped_s: float | None = None

    def set_sensor(self, rig: MountedHousing, change_u_g: Array, warnings: tuple[Reason, ...]) -> None:
        """Set the same housing with other uncertainties of its sensor.

        `change_u_g`: standard uncertainty of how far the offsets have changed, shape (3,); `warnings`: why.
        """
        self._rig, self._warnings = rig.moving_with_load(), warnings
        self.tracker.widen_offset(change_u_g)
        if self.sharpened is not None:
            self.sharpened.tracker.widen_offset(change_u_g)

    def gyro_bias_rad_s(self) -> Array | None:
        """Return the reading of the gyroscope at rest, shape (3,); None where it is not known, or without a gyroscope in use."""
        return None if self.sharpened is None else self.sharpened.bias_rad_s()

    def widen_gyro_bias(self, u_rad_s: float) -> None:
        """Add an unknown change of the gyroscope's bias, standard uncertainty, as by a temperature."""
        if self.sharpened is not None:
            self.sharpened.tracker.widen_gyro_bias(u_rad_s)

    def update(
        self,
        time_s: Array,
        force_g: Array,
        is_clipped: NDArray[np.bool_] | None = None,
        rate_rad_s: Array | None = None,
    ) -> None:
        """Take a block of specific force in the housing frame, shapes (n,) and (n, 3).

        `is_clipped`: which of its samples are, shape (n,); None: none. `rate_rad_s`: angular rates in the housing frame, shape
        (n, 3), NaN where a sample has none; None without a gyroscope.
        """
        has_clipped = is_clipped is not None and bool(is_clipped.any())
        if not has_clipped or self._unclipped_s is None:
            self._unclipped_s = float(time_s[-1])
        had_fault = self._faults.fault is not None
        self._faults.update(time_s, force_g)
        if self._faults.fault is None:
            at_s, clipped = time_s - delay_s(self._rig.bandwidth_hz), is_clipped if has_clipped else None
            self.tracker.update(at_s, force_g, clipped)
            if self.sharpened is not None and rate_rad_s is not None:
                self.sharpened.update(at_s, force_g, clipped, rate_rad_s, self.tracker)
            self._count_outliers(float(time_s[-1]))
        elif not had_fault:
            self._new_trackers()  # they have been fed with wrong readings

    def estimate(self, now_s: float) -> MotionEstimate:
        """Return the motion at a time not before the newest sample."""
        estimate = self.tracker.estimate(now_s)
        if self.sharpened is not None:
            estimate = self.sharpened.choose(estimate, now_s)
        if (why := self._why_unknown(now_s)) is not None:
            return MotionEstimate(time_s=now_s, state="unknown", reasons=(why,))
        if estimate.angle_rad is None:
            why = Reason("undetermined", "the readings so far do not determine the angle")
            return replace(estimate, reasons=(*(estimate.reasons or (why,)), *self._warnings))
        contradiction_u = self._faults.contradiction_u_rel
        parts = (max(self._rig.scale_u), _attenuation(self._rig, estimate.period_s), self._faults.undecided_u_rel)
        contradicting = (CONTRADICTION,) if contradiction_u > 0 else ()
        fault = None if self.sharpened is None else self.sharpened.check.fault
        reasons = (*estimate.reasons, *contradicting, *(() if fault is None else (fault,)), *self._warnings)
        return _with_relative_uncertainty(estimate, math.hypot(*parts), contradiction_u, reasons)

    @property
    def has_fault(self) -> bool:
        """Whether the sensor is at fault, so that its readings are left out."""
        return self._faults.fault is not None

    @property
    def is_explained(self) -> bool:
        """Whether the motion explains the readings of the last seconds."""
        return not self._outliers or self._outliers[-1][1] - self._outliers[0][1] < MOST_OUTLIERS

    def _why_unknown(self, now_s: float) -> Reason | None:
        if self._unclipped_s is None:
            return Reason("no_reading", "no reading yet")
        if self._faults.fault is not None:
            return self._faults.fault
        if not self._faults.is_ready:
            return Reason("too_short", "less than half a swing observed")
        if self._is_blind_at_load():
            return UNCALIBRATED_AT_LOAD
        if now_s - self._unclipped_s > LONGEST_CLIPPING_S:
            words = f"clipped for {now_s - self._unclipped_s:.0f} s: readings reach full scale"
            return Reason("clipped_long", words)
        return None

    def _is_blind_at_load(self) -> bool:
        above_m = self._rig.above_load_m
        if self._rig.mounted_on == "spreader":
            return False  # it reads the direction of the ropes' force across them
        if above_m is None or above_m >= SHORTEST_DISTANCE * self._rig.length_m:
            return False
        return math.hypot(self._rig.zero_g_offset_u_g[2], self._rig.scale_u[2]) > LARGEST_AXIAL_U_G

    def _count_outliers(self, now_s: float) -> None:
        self._outliers.append((now_s, self.tracker.outliers))
        while self._outliers[0][0] < now_s - UNEXPLAINED_S:
            self._outliers.popleft()

    def _new_trackers(self) -> None:
        self._outliers: deque[tuple[float, int]] = deque()
        """Time and number of all outliers so far."""
        self.tracker = MotionTracker(
            self._rig, mount_u_rad=self._mount_u_rad, noise_g=self._noise_g, keeps_steps=self._keeps_steps
        )
        self.sharpened = None
        if self._gyro is not None:
            self.sharpened = GyroTracker(
                self._rig, self._mount_u_rad, self._noise_g, self._gyro, keeps_steps=self._keeps_steps
            )


def _attenuation(rig: MountedHousing, period_s: float | None) -> float:
    """Return how much the sensor's low-pass, taken as a single pole, reduces a swing; the filter does not correct it.

    The axial reading swings twice as fast with the square of the angle: it loses four times as much, which halves in the angle.
    Twice that, because what the low-pass changes may be taken for a slow drive or a wind.
    """
    if period_s is None:
        return 0.0
    return 2 * (2 * np.pi * delay_s(rig.bandwidth_hz) / period_s) ** 2


def _with_relative_uncertainty(
    estimate: MotionEstimate, u_rel: float, u_rel_of_largest: float, reasons: tuple[Reason, ...]
) -> MotionEstimate:
    """Return the estimate with other reasons and uncertainties: relative ones, and of the largest angle of the last period."""
    if estimate.angle_rad is None or estimate.u_rad is None:
        return replace(estimate, reasons=reasons)
    added_rad = u_rel_of_largest * (estimate.angle_rad if estimate.last_peak is None else estimate.last_peak.angle_rad)
    return replace(
        estimate,
        u_rad=math.hypot(estimate.u_rad, u_rel * estimate.angle_rad, added_rad),
        next_peak=_widened(estimate.next_peak, u_rel, added_rad),
        next_peak_if_coasting=_widened(estimate.next_peak_if_coasting, u_rel, added_rad),
        last_peak=_widened(estimate.last_peak, u_rel, added_rad),
        reasons=reasons,
    )


def _widened(peak: PeakEstimate | None, u_rel: float, added_rad: float) -> PeakEstimate | None:
    if peak is None:
        return None
    u_rad = math.hypot(peak.u_rad, u_rel * peak.angle_rad, added_rad)
    return PeakEstimate(angle_rad=peak.angle_rad, u_rad=u_rad, in_s=peak.in_s)
