"""The motion of a live stream: blocks of samples in, an estimate at any time out; pure and deterministic."""

import cmath
import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.motion.binning import Binning, ForceBin
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.motion.fast_oscillation import FastOscillationDetector
from gateway.motion.filter_run import FilterRun
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.hypotheses import LOAD_SIGN
from gateway.motion.initial_state import SMALLEST_OFFSET_U_G, constants_of
from gateway.motion.moments import mixture_moments, variance_along
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.motion_state import motion_state
from gateway.motion.oscillation_estimate import oscillation_share
from gateway.motion.peaks import PHASE_STATES, SwingPhase, ellipse, next_peak
from gateway.motion.rope_model import LARGEST_ANGLE_RAD, RopeModel
from gateway.motion.state_vector import (
    DAMPING,
    GRAVITY,
    GYRO_BIAS,
    HOIST_SPEED,
    INPUT,
    LN_LENGTH,
    N_GYRO_STATES,
    N_STATES,
    RATE,
    SIDE_FORCE,
)
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.swing.rig import MountedHousing

LONGEST_BIN_S = 0.1
BINS_PER_PERIOD = 60
"""Fewest bins in the period of a small swing. Basis: the Taylor step's error of 1e-6 per bin."""
LARGEST_SETBACK_S = 10.0
"""Bins that come late by less are left out; times that go back by more begin anew."""
LONGEST_AHEAD_S = 1.5
"""Longest time for which the motion is extrapolated beyond the newest bin. Basis: lasting clipping is unknown after a second."""
LARGEST_U_RAD = np.radians(5.0)
"""Standard uncertainty from which on an angle counts as not known."""
LONGEST_GAP_S = 120.0
"""A longer gap starts the motion anew; the sensor's constants stay."""
SECOND_ACCOUNT_BINS = 192
"""Bins of which a second account is made: twenty seconds, at least one swing."""
RECENT_BINS = 20
"""Bins of one that is made because the first is doubtful."""
CATCH_UP_BINS = 3
"""Bins that a second account takes for each new one, so that no update costs much more than another."""
MOST_BRIDGING_STEPS = 10
"""Steps through a gap in one update, which must not hold the interpreter for long. The angle is not known meanwhile: for three
seconds after a gap of a minute, when the fault detector has not seen half a swing either."""
FEWEST_SECOND_BINS, SETTLING_BINS = 60, 30
"""Bins before a second account is compared, and its first ones, which are not: it knows nothing before them."""
TAKE_OVER_EVIDENCE = 15.0
"""Gain in log evidence that lets it take over."""


class MotionTracker:
    """Feeds the motion filter with bins and describes its state.

    A second account of the newest bins is computed where the first one is doubtful or a fast oscillation has been found in them.
    It takes over where the bins are clearly more probable under it.
    """

    def __init__(
        self,
        rig: MountedHousing,
        *,
        mount_u_rad: float,
        noise_g: float | None = None,
        gyro: GyroPrior | None = None,
    ) -> None:
        """`mount_u_rad`: standard uncertainty of the housing's z axis against the rope; `noise_g`: stated, 1 sigma per sample.

        `gyro`: what is known of the gyroscope; None: there is none.
        """
        self._rig, self._noise_g, self._gyro = rig, noise_g, gyro
        self._constants = constants_of(rig, mount_u_rad)
        self._bin_s = min(LONGEST_BIN_S, rig.small_swing_period_s / BINS_PER_PERIOD)
        self._binning = Binning(self._bin_s)
        self._run = self._new_run()
        self._oscillation = FastOscillationDetector(self._bin_s, 2 * np.pi / rig.small_swing_period_s)
        self._bins: deque[ForceBin] = deque(maxlen=SECOND_ACCOUNT_BINS)
        self._waiting: deque[ForceBin] = deque()
        """Bins after a gap that is not bridged yet."""
        self._steps_left = MOST_BRIDGING_STEPS
        """That this update may make through a gap."""
        self._second: FilterRun | None = None
        self._backlog: deque[ForceBin] = deque()
        """Bins that the second account has not taken yet."""
        self._second_bins = 0
        self._rest_bins = 0
        """Bins until another second account may begin."""
        self._angles: deque[tuple[float, float, float]] = deque()
        """Time, angle and uncertainty of the last period."""

    @property
    def outliers(self) -> int:
        """Bins that no hypothesis explained."""
        return self._run.outliers

    @property
    def rate_squared(self) -> float:
        """Mean of the normalised innovation squared of the gyroscope's readings; 3 is expected."""
        return self._run.rate_squared

    @property
    def force_evidence(self) -> float:
        """Log evidence of the newest forces, without that of a gyroscope's rates."""
        return self._run.force_evidence

    def gyro_bias(self) -> tuple[Array, Array] | None:
        """Return the gyroscope's bias and its standard uncertainty, rad/s, shapes (3,); None without one."""
        if self._gyro is None or self._run.is_broken:
            return None
        mean, covariance = mixture_moments(self._run.filter.mixture)
        return mean[GYRO_BIAS], np.sqrt(np.diagonal(covariance)[GYRO_BIAS])

    def update(
        self,
        time_s: Array,
        force_g: Array,
        is_clipped: NDArray[np.bool_] | None = None,
        rate_rad_s: Array | None = None,
    ) -> bool:
        """Take a block in the housing frame, shapes (n,), (n, 3), (n,) and (n, 3); return whether a bin was completed."""
        if len(time_s) == 0:
            return False
        self._steps_left = MOST_BRIDGING_STEPS
        bins = self._binning.add(time_s, force_g, is_clipped, None if self._gyro is None else rate_rad_s)
        for one in bins:
            self._take(one)
        return bool(bins)

    def set_offset_uncertainty(self, offset_u_g: Array, change_u_g: Array) -> None:
        """State how well the offsets are known from now on, and by how much they may have changed; shape (3,), 1 sigma."""
        x, y, z = (max(SMALLEST_OFFSET_U_G, float(u_g)) for u_g in offset_u_g)
        self._constants = replace(self._constants, offset_u_g=(x, y, z))
        for run in (self._run, self._second):
            if run is not None:
                run.filter.widen_offset(change_u_g)

    def _new_run(self) -> FilterRun:
        n_states = N_STATES if self._gyro is None else N_STATES + N_GYRO_STATES
        model = RopeModel(self._rig.gravity_m_s2, self._rig.above_load_m is not None, n_states)
        return FilterRun(MotionFilter(model, self._constants, self._gyro), self._bin_s, self._noise_g, self._gyro)

    def widen_gyro_bias(self, u_rad_s: float) -> None:
        """Add an unknown change of the gyroscope's bias, standard uncertainty, as by a temperature."""
        for run in (self._run, self._second):
            if run is not None and run.has_gyro:
                run.filter.widen_gyro_bias(u_rad_s)

    def _take(self, one: ForceBin) -> None:
        newest_s = self._waiting[-1].time_s if self._waiting else self._run.newest_s
        if newest_s is not None:
            step_s = one.time_s - newest_s
            if -LARGEST_SETBACK_S < step_s <= 0:
                return
            if step_s <= -LARGEST_SETBACK_S or step_s > LONGEST_GAP_S or self._run.is_broken:
                self._run, self._second = self._new_run(), None
                self._angles.clear()
                self._waiting.clear()
            if not 0 < step_s < 1.5 * self._bin_s:
                self._bins.clear()
                self._oscillation.clear()
                self._second = None
        self._waiting.append(one)
        for _ in range(min(CATCH_UP_BINS, len(self._waiting))):
            needed = self._run.steps_to(self._waiting[0].time_s)
            steps = min(needed, self._steps_left)
            self._run.bridge(self._waiting[0].time_s, steps)
            self._steps_left -= steps
            if steps < needed:
                return
            self._follow(self._waiting.popleft())

    def _follow(self, one: ForceBin) -> None:
        self._run.take(one)
        self._bins.append(one)
        if self._second is not None:
            self._backlog.append(one)
            self._advance_second(self._second)
        self._rest_bins = max(0, self._rest_bins - 1)
        if one.is_usable and self._oscillation.add(one.force_g):
            self._follow_line()
        if self._second is None and self._rest_bins == 0 and self._run.is_doubtful:
            self._begin_second(RECENT_BINS)

    def _follow_line(self) -> None:
        found = self._oscillation.found
        if self._second is not None:
            self._second.follow_line(found)
        if self._run.misses_line(found) and self._second is None:
            self._begin_second()
        if self._run.filter.line_rate_1_s is not None:
            self._run.follow_line(found)

    def _begin_second(self, bins: int = SECOND_ACCOUNT_BINS) -> None:
        self._second, self._second_bins = self._new_run(), 0
        self._backlog = deque(list(self._bins)[-bins:])
        self._second.follow_line(self._oscillation.found)

    def _advance_second(self, second: FilterRun) -> None:
        for _ in range(min(CATCH_UP_BINS, len(self._backlog))):
            second.take(self._backlog.popleft())
            self._second_bins += 1
        if self._backlog or self._second_bins < FEWEST_SECOND_BINS:
            return
        compared = self._second_bins - SETTLING_BINS
        gained = second.evidence(compared) - self._run.evidence(compared)
        if gained > TAKE_OVER_EVIDENCE and second.is_locked:
            second.outliers += self._run.outliers
            self._run, self._second = second, None
        elif self._second_bins > SECOND_ACCOUNT_BINS:
            self._second, self._rest_bins = None, SECOND_ACCOUNT_BINS // 2

    def estimate(self, now_s: float) -> MotionEstimate:
        """Return the motion at a time not before the newest bin; call it at most once per published message."""
        if self._run.newest_s is None:
            return MotionEstimate(time_s=now_s, state="unknown", reasons=("no reading yet",))
        ahead_s = now_s - self._run.newest_s
        if self._waiting:
            return MotionEstimate(
                time_s=now_s, state="unknown", reasons=(f"a gap of {ahead_s:.0f} s is being bridged",)
            )
        if ahead_s > LONGEST_AHEAD_S or self._run.is_broken:
            return MotionEstimate(time_s=now_s, state="unknown", reasons=("no reading that can be used",))
        mean, covariance = mixture_moments(self._run.filter.mixture)
        return self._describe(now_s, ahead_s, mean, covariance)

    def _describe(self, now_s: float, ahead_s: float, mean: Array, covariance: Array) -> MotionEstimate:
        mixture, g = self._run.filter.mixture, self._rig.gravity_m_s2
        x, sigma = mean.tolist(), np.sqrt(np.diagonal(covariance)).tolist()
        u, w, side, pivot = (complex(*x[pair]) for pair in (GRAVITY, RATE, SIDE_FORCE, INPUT))
        length_m = math.exp(x[LN_LENGTH])
        rate_1_s = math.sqrt(g / length_m)
        pushing = complex(*((mixture.weight * LOAD_SIGN) @ mixture.state[:, INPUT]).tolist())
        damping_1_s = x[DAMPING] + 2 * x[HOIST_SPEED] / length_m
        acceleration = rate_1_s**2 * (u + side + pushing) - damping_1_s * w
        u -= ahead_s * (w + 0.5 * ahead_s * acceleration)
        w += ahead_s * acceleration

        sine = min(abs(u), 1.0)
        angle_rad, towards = math.asin(sine), u / max(sine, 1e-9)
        along = variance_along(covariance[GRAVITY, GRAVITY].tolist(), towards)
        total = sigma[0] ** 2 + sigma[1] ** 2
        share = sine**2 / (sine**2 + total)
        u_rad = math.sqrt(share * along + (1 - share) * total)
        major, minor, direction = ellipse(u + side, -w / rate_1_s)
        self._remember(now_s, angle_rad, u_rad, 2 * math.pi / rate_1_s)
        is_known = u_rad < LARGEST_U_RAD and angle_rad + NORMAL_975 * u_rad < LARGEST_ANGLE_RAD
        start = np.array([part for pair in (u, w, side, pivot) for part in (pair.real, pair.imag)])
        phase = SwingPhase(start, covariance[PHASE_STATES], rate_1_s)
        return MotionEstimate(
            time_s=now_s,
            state=motion_state(mixture.weight, major, math.sqrt(total), x[HOIST_SPEED], sigma[HOIST_SPEED])
            if is_known
            else "unknown",
            angle_rad=angle_rad if is_known else None,
            u_rad=u_rad if is_known else None,
            azimuth_rad=cmath.phase(-u) if is_known else None,
            rate_rad_s=-(towards * w.conjugate()).real if is_known else None,
            pivot_acceleration_m_s2=(pivot.real * g, pivot.imag * g),
            pivot_acceleration_u_m_s2=math.hypot(*sigma[INPUT]) / math.sqrt(2) * g,
            hoist_m_s=x[HOIST_SPEED],
            hoist_u_m_s=sigma[HOIST_SPEED],
            probabilities=tuple(mixture.weight.tolist()),
            next_peak=next_peak(phase, is_driven=True) if is_known else None,
            next_peak_if_coasting=next_peak(phase, is_driven=False) if is_known else None,
            last_peak=self._last_peak(now_s) if is_known else None,
            amplitude_rad=2 * math.asin(min(major / 2, 1.0)),
            minor_amplitude_rad=2 * math.asin(min(minor / 2, 1.0)),
            major_azimuth_rad=direction,
            lean_rad=math.asin(min(abs(side), 1.0)),
            lean_u_rad=math.hypot(*sigma[SIDE_FORCE]) / math.sqrt(2),
            lean_azimuth_rad=cmath.phase(side),
            period_s=2 * math.pi / rate_1_s,
            length_m=length_m,
            length_u_m=length_m * sigma[LN_LENGTH],
            fast_oscillation=oscillation_share(self._rig, self._run.filter.line_rate_1_s, x),
        )

    def _remember(self, now_s: float, angle_rad: float, u_rad: float, period_s: float) -> None:
        self._angles.append((now_s, angle_rad, u_rad))
        while self._angles[0][0] < now_s - period_s:
            self._angles.popleft()

    def _last_peak(self, now_s: float) -> PeakEstimate:
        time_s, angle_rad, u_rad = max(self._angles, key=lambda one: one[1])
        return PeakEstimate(angle_rad=angle_rad, u_rad=u_rad, in_s=time_s - now_s)
