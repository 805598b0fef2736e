"""A candidate account of the motion: a filter with one structure of the crane, its time and the evidence for it."""

import math
from collections import deque

import numpy as np

from gateway.motion.binning import BinNoise, ForceBin
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.motion_filter import EXPECTED_SQUARED, MotionFilter
from gateway.motion.state_vector import GRAVITY, indices
from gateway.motion.step_record import Moments, StepHistory, StepRecord
from gateway.numerics.array import Array

EVIDENCE_TIME_S = 60.0
"""Time over which the evidence for candidates is summed. Basis: some swings."""
COMPARED_BINS = 25
"""Newest bins whose forces are compared between the accounts with and without a gyroscope: some ten seconds."""
INNOVATION_MEMORY = 0.9
"""Weight of the earlier innovations of a gyroscope in their mean: some four seconds."""
LARGEST_SQUARED = 40 * EXPECTED_SQUARED
"""The most that one innovation counts in it."""
SPREADER_U_REL = 0.03
"""Relative standard uncertainty of an angle on a spreader beyond the filter's. Basis: simulated spreaders, whose ropes converge
differently in two planes."""
LONGEST_STEP_BINS = 1.5
"""Longest step of a prediction, in bins. Basis: the Taylor step's error."""
FORGOTTEN_PERIODS = 2.0
"""Time without readings, in periods of a small swing, after which the motion is not known any more, but the constants are."""


class MotionCandidate:
    """A filter that takes bins."""

    def __init__(
        self, motion_filter: MotionFilter, bin_s: float, period_s: float, gyro: GyroPrior | None, name: str
    ) -> None:
        """`period_s`: of a small swing on the rope as stated; `name`: of its structure of the crane."""
        self.filter, self.name = motion_filter, name
        self.newest_s: float | None = None
        self.outliers = 0
        self.evidence = 0.0
        """Log evidence of the newest readings, summed with a memory of a minute."""
        self.rate_squared = EXPECTED_SQUARED
        """Mean of the normalised innovation squared of the gyroscope's readings."""
        self._bin_s, self._period_s, self._gyro = bin_s, period_s, gyro
        self.history: StepHistory | None = None
        """The steps so far, where a smoother needs them."""
        self._force_evidence: deque[float] = deque(maxlen=COMPARED_BINS)
        self._gyro_noise = BinNoise()

    def moments(self) -> tuple[Array, Array]:
        """Return mean and covariance over all hypotheses, widened by what the structure of the crane leaves out."""
        mean, covariance = self.filter.mixture.moments()
        if self.filter.model.on_spreader:
            squared = SPREADER_U_REL**2 * float(mean[GRAVITY] @ mean[GRAVITY])
            covariance[indices(GRAVITY), indices(GRAVITY)] += squared
        return mean, covariance

    @property
    def force_evidence(self) -> float:
        """Log evidence of the accelerometer's newest readings, without those of a gyroscope."""
        return sum(self._force_evidence)

    @np.errstate(over="ignore", invalid="ignore")  # an account that diverges is broken, and made anew
    def take(self, one: ForceBin, sigma_g: Array) -> None:
        """Take the next bin, `sigma_g`: its standard deviation, shape (3,)."""
        if self.newest_s is not None:
            self._advance(one.time_s - self.newest_s)
        self.newest_s = one.time_s
        if one.is_usable:
            self.outliers += self.filter.update(one.force_g, sigma_g)
            self._force_evidence.append(self.filter.log_evidence)
        self._take_rate(one)
        if self.history is not None:
            self.history.newest = (one.time_s, Moments.of(self.filter.mixture))
        if one.is_usable:
            self.evidence = self.evidence * math.exp(-self._bin_s / EVIDENCE_TIME_S) + self.filter.log_evidence

    def _advance(self, time_s: float) -> None:
        if time_s > FORGOTTEN_PERIODS * self._period_s:
            before = self.filter.mixture
            self.filter.forget_motion()
            if self.history is not None:
                self.history.steps.append(StepRecord.forgetting(self.newest_s, before, self.filter.mixture))
            return
        steps = max(1, math.ceil(time_s / (LONGEST_STEP_BINS * self._bin_s)))
        for step in range(steps):
            if self.history is None:
                self.filter.predict(time_s / steps)
            else:
                at_s = self.newest_s if step == 0 else None
                self.history.steps.append(self.filter.recorded_predict(time_s / steps, at_s))

    def _take_rate(self, one: ForceBin) -> None:
        """Take the reading of the gyroscope."""
        if self._gyro is None or one.rate_rad_s is None or self.filter.is_broken:
            return
        self._gyro_noise.add(one.rate_rad_s)
        if not self._gyro_noise.is_known:
            return
        sigma_rad_s = self._gyro_noise.sigma_g((self._gyro.noise_rad_s or 0.0) / math.sqrt(one.count))
        squared = min(self.filter.update_rate(one.rate_rad_s, sigma_rad_s), LARGEST_SQUARED)
        self.rate_squared += (1 - INNOVATION_MEMORY) * (squared - self.rate_squared)
