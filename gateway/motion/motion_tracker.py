"""The motion of a live stream: blocks of samples in, an estimate at any time out; pure and deterministic.

A bank of candidates takes every bin. Each is one structure of the crane: a housing that turns with the rope, or one on a spreader
near the load, which does not, on a base that stands or on one that floats. They start together; all bins of both count; while
their evidence does not tell them apart the estimate holds both, and one that is excluded ends.
"""

import math
from collections import deque
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gateway.configuration.model import MountedOn
from gateway.messages.header import Reason
from gateway.motion.binning import BinGroups, Binning, ForceBin
from gateway.motion.candidate import MotionCandidate
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.motion.fast_oscillation import FastOscillationDetector
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.hypotheses import FLOATING_SHARE
from gateway.motion.initial_state import constants_of
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_estimate import Angle, Described, describe, swing_phase
from gateway.motion.state_vector import AXIAL_OFFSET, GYRO_BIAS, N_GYRO_STATES, N_STATES, OFFSET
from gateway.motion.step_record import StepHistory
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing

LONGEST_BIN_S, BINS_PER_PERIOD = 0.5, 20
"""Longest bin, and bins in the period of a small swing. Basis: long enough to average the second mode of a load in slings and the
strings of a rope. On simulated cranes 24 bins take 5 % off the error of the angle; on ideal ones they add 10 %, and a
fifth of the cost."""
SHORT_BIN_S = 0.1
"""Longest of the bins in which fast oscillations are found, and by whose scatter a long bin's noise is known."""
SCATTER_SHARE = np.array([1.0, 1.0, 0.3])
"""Share of the scatter within a bin that is noise of its mean. Basis: along the rope most of it is the jerk of a winch, which the
mean shows as it is: with 0 and 0.6 the error of the angle on 54 simulated cranes is 2 to 6 % larger. A noise that is remembered
from bin to bin, in place of this or beside it, makes it 5 to 18 % larger: vibration and impacts come and go."""
UNKNOWN_NOISE_G = 1e-3
"""Of one sample, where it is neither stated nor seen by the scatter of several."""
LARGEST_SETBACK_S = 10.0
"""Bins that come late by less are left out; times that go back by more begin anew."""
LONGEST_AHEAD_S = 1.5
"""Longest time for which the motion is extrapolated beyond the newest bin. Basis: lasting clipping is unknown after a second."""
CONVERGING, CONVERGING_U = 0.05, 0.03
"""Share by which a housing on one of several ropes that converge reads as if it were nearer to the load, and its standard
deviation. Basis: 0.03 to 0.09 on simulated container cranes, because the other ropes hold the spreader too."""
EXCLUDED_EVIDENCE = 40.0
"""Evidence by which a candidate falls behind the best one when it ends. Basis: on one of 80 simulated cranes a wrong structure
was ahead by 20 for a while; errors of the equations last, so that these are no odds of 5e8."""


class MotionTracker:
    """Feeds candidates with bins and describes what they agree on."""

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
        self._rig, self._noise_g, self._gyro, self._keeps_steps = rig, noise_g, gyro, keeps_steps
        self.ended: list[StepHistory] = []
        """Steps of the accounts that ended because the time went back or their numbers were lost."""
        self._mount_u_rad = mount_u_rad
        period_s = rig.small_swing_period_s
        self.bin_s = min(LONGEST_BIN_S, period_s / BINS_PER_PERIOD)
        size = max(3, math.ceil(self.bin_s / SHORT_BIN_S - 1e-9))
        self._short_s = self.bin_s / size
        self._binning, self._groups = Binning(self._short_s), BinGroups(self._short_s, size)
        self._oscillation = FastOscillationDetector(self._short_s, 2 * np.pi / period_s)
        self._newest_short_s: float | None = None
        self._outliers_before = 0
        self._angles: deque[tuple[float, float, float]] = deque()
        """Time, angle and uncertainty of the last period."""
        self.candidates = self._new_candidates()
        self._state = self._over_candidates()
        """After the newest bin."""

    @property
    def leader(self) -> MotionCandidate:
        """The candidate that explains the newest readings best."""
        return max(self.candidates, key=lambda one: one.evidence)

    @property
    def outliers(self) -> int:
        """Bins that no hypothesis explained; it never falls."""
        return self._outliers_before + self.leader.outliers

    @property
    def rate_squared(self) -> float:
        """Mean of the normalised innovation squared of the gyroscope's readings; 3 is expected."""
        return self.leader.rate_squared

    @property
    def force_evidence(self) -> float:
        """Log evidence of the newest forces, without that of a gyroscope's rates."""
        return self.leader.force_evidence

    def gyro_bias(self) -> tuple[Array, Array] | None:
        """Return the gyroscope's bias and its standard uncertainty, rad/s, shapes (3,); None without one."""
        if self._gyro is None or self.leader.filter.is_broken:
            return None
        mean, covariance = self.leader.filter.mixture.moments()
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
        newest_s = self.leader.newest_s
        for one in self._binning.add(time_s, force_g, is_clipped, None if self._gyro is None else rate_rad_s):
            self._take_short(one)
        return self.leader.newest_s != newest_s

    def finish(self) -> None:
        """Take the samples of the bins that are not complete; there are no later ones."""
        for one in self._binning.finish():
            self._take_short(one)
        for group in self._groups.finish():
            self._take(group)

    def widen_offset(self, change_u_g: Array) -> None:
        """Add an unknown change of the offsets, standard uncertainties of shape (3,), as by a temperature."""
        for candidate in self.candidates:
            candidate.filter.widen(OFFSET, change_u_g[:2])
            candidate.filter.widen(AXIAL_OFFSET, change_u_g[2:])
        self._state = self._over_candidates()

    def widen_gyro_bias(self, u_rad_s: float) -> None:
        """Add an unknown change of the gyroscope's bias, standard uncertainty, as by a temperature."""
        if self._gyro is not None:
            for candidate in self.candidates:
                candidate.filter.widen(GYRO_BIAS, u_rad_s)

    def _new_candidates(self) -> list[MotionCandidate]:
        structures = product(self._rig.possible_clamps, self._rig.possible_structures, (False, True))
        return [self._new_candidate(rig, mounted_on, floats=floats) for rig, mounted_on, floats in structures]

    def _new_candidate(self, rig: MountedHousing, mounted_on: MountedOn, *, floats: bool) -> MotionCandidate:
        constants, on_spreader = constants_of(rig, self._mount_u_rad), mounted_on == "spreader"
        if mounted_on == "converging_ropes":
            shift_m, u_m = CONVERGING * self._rig.length_m, CONVERGING_U * self._rig.length_m
            place_u_m = math.hypot(constants.place_u_m, u_m)
            constants = replace(constants, place_m=constants.place_m - shift_m, place_u_m=place_u_m)
        model = RopeModel(
            self._rig.gravity_m_s2,
            self._rig.length_m,
            is_clamped=rig.above_load_m is not None,
            on_spreader=on_spreader,
            n_states=N_STATES + (0 if self._gyro is None else N_GYRO_STATES),
        )
        motion_filter = MotionFilter(model, constants, self._gyro, floats=floats)
        candidate = MotionCandidate(motion_filter, self.bin_s, self._rig.small_swing_period_s, self._gyro, mounted_on)
        candidate.evidence = math.log(FLOATING_SHARE if floats else 1 - FLOATING_SHARE)
        candidate.history = StepHistory() if self._keeps_steps else None
        return candidate

    def _take_short(self, one: ForceBin) -> None:
        newest_s = self._newest_short_s
        if newest_s is not None:
            step_s = one.time_s - newest_s
            if -LARGEST_SETBACK_S < step_s <= 0:
                return
            if step_s <= -LARGEST_SETBACK_S:
                self._begin_anew()
            if not 0 < step_s < 1.5 * self._short_s:
                self._oscillation.clear()
        self._newest_short_s = one.time_s
        if one.is_usable and self._oscillation.add(one.force_g):
            for candidate in self.candidates:
                candidate.filter.follow_line(self._oscillation.found)
        for group in self._groups.add(one):
            self._take(group)
        self._remember(one.time_s)

    def _take(self, one: ForceBin) -> None:
        sigma_g = self._sigma_g(one)
        for candidate in self.candidates:
            candidate.take(one, sigma_g)
        working = [candidate for candidate in self.candidates if not candidate.filter.is_broken]
        if working:
            best = max(candidate.evidence for candidate in working)
            self.candidates = [candidate for candidate in working if best - candidate.evidence < EXCLUDED_EVIDENCE]
        else:
            self._begin_anew()
        self._state = self._over_candidates()

    def _sigma_g(self, one: ForceBin) -> Array:
        """Return the standard deviation of a long bin's mean, shape (3,)."""
        is_unknown = self._noise_g is None and one.scatter_g is None
        stated_g = np.full(3, (UNKNOWN_NOISE_G if is_unknown else self._noise_g or 0.0) / math.sqrt(one.count))
        return stated_g if one.scatter_g is None else np.maximum(stated_g, SCATTER_SHARE * one.scatter_g)

    def _begin_anew(self) -> None:
        self._outliers_before += self.leader.outliers
        if self.leader.history is not None:
            self.ended.append(self.leader.history)
        self.candidates = self._new_candidates()
        self._angles.clear()

    def _over_candidates(self) -> Described:
        """Return the state over all hypotheses of all candidates at the newest bin."""
        best = self.leader
        mean, covariance = best.moments()
        weight = best.filter.mixture.weight
        if len(self.candidates) > 1:
            shares = np.exp([candidate.evidence - best.evidence for candidate in self.candidates])
            shares /= shares.sum()
            moments = [candidate.moments() for candidate in self.candidates]
            mean = np.tensordot(shares, [part for part, _ in moments], 1)
            covariance = np.tensordot(shares, [part for _, part in moments], 1)
            for share, (part, _) in zip(shares, moments, strict=True):
                covariance += share * np.multiply.outer(part - mean, part - mean)
            weight = np.tensordot(shares, [candidate.filter.mixture.weight for candidate in self.candidates], 1)
        return Described(mean, covariance, weight, best.filter.line_rate_1_s)

    def estimate(self, now_s: float) -> MotionEstimate:
        """Return the motion at a time not before the newest bin."""
        newest_s = self.leader.newest_s
        if newest_s is None:
            return MotionEstimate(time_s=now_s, state="unknown", reasons=(Reason("no_reading", "no reading yet"),))
        ahead_s = now_s - newest_s
        if ahead_s > LONGEST_AHEAD_S + self.bin_s or self.leader.filter.is_broken:
            return MotionEstimate(
                time_s=now_s, state="unknown", reasons=(Reason("no_reading", "no reading that can be used"),)
            )
        return describe(self._state, self._rig.gravity_m_s2, now_s, ahead_s, self._largest(now_s))

    def _remember(self, now_s: float) -> None:
        newest_s = self.leader.newest_s
        if newest_s is None or now_s < newest_s:
            return
        phase = swing_phase(self._state, self._rig.gravity_m_s2, now_s - newest_s)
        angle = Angle.of(complex(*phase.mean[:2]), phase.covariance[:2, :2])
        self._angles.append((now_s, angle.angle_rad, angle.u_rad))
        while self._angles[0][0] < now_s - 2 * math.pi / phase.rate_1_s:
            self._angles.popleft()

    def _largest(self, now_s: float) -> PeakEstimate | None:
        if not self._angles:
            return None
        time_s, angle_rad, u_rad = max(self._angles, key=lambda one: one[1])
        return PeakEstimate(angle_rad=angle_rad, u_rad=u_rad, in_s=time_s - now_s)
