"""A motion filter fed with bins: predictions between them, their noise, and the evidence for the filter's account of them."""

import math
from collections import deque

import numpy as np

from gateway.motion.bin_noise import BinNoise
from gateway.motion.binning import ForceBin
from gateway.motion.fast_oscillation import FastOscillation
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.hypotheses import PIVOT_SIGN, MotionHypothesis, probabilities
from gateway.motion.motion_filter import EXPECTED_SQUARED, MotionFilter
from gateway.motion.state_vector import HOIST_SPEED, INPUT, LINE, PIVOT_VELOCITY
from gateway.numerics.array import Array

UNKNOWN_NOISE_G = 1e-3
"""Of one sample of a sensor whose noise is not stated, before it is measured."""
EVIDENCE_BINS = 192
"""Newest bins over which two accounts are compared."""
COMPARED_BINS = 60
"""Newest bins whose forces are compared between the accounts with and without a gyroscope."""
INNOVATION_MEMORY = 0.95
"""Weight of the earlier innovations in their mean: two seconds."""
POOR_SQUARED = 4.0 * EXPECTED_SQUARED
"""Mean of the normalised innovation squared from which on the account is doubted."""
LONGEST_ACT_S, SLOW_HOIST_M_S = 8.0, 0.05
"""Duration of a drive, of a gust or of a hoist without speed from which on the account is doubted."""
LOCKED_WEIGHT = 0.9
"""Weight of the free swing from which on an account that began from nothing is believed."""
LINE_TOLERANCE = 0.02
"""Relative error of a fast oscillation's first frequency: half a radian after five seconds at 1 Hz."""
BRIDGING_BINS, STEPS_PER_EXCHANGE = 3.0, 4
"""Bins in a step through a gap, and steps that share an exchange of probability. Basis: swings of 4 and 15 degrees after gaps of
3 to 100 s, with normalised errors of 0.4 to 1.3 rms."""
IMPLAUSIBLE_SPEED_M_S, IMPLAUSIBLE_ACCELERATION_G = 6.0, 0.2
"""Of the pivot: more than any crane."""


class FilterRun:
    """A filter with the time and the noise of the bins that it has taken."""

    def __init__(
        self, motion_filter: MotionFilter, bin_s: float, noise_g: float | None, gyro: GyroPrior | None = None
    ) -> None:
        """`noise_g`: stated, 1 sigma per sample; None: to be measured. `gyro`: that of the filter."""
        self.filter = motion_filter
        self.has_gyro = gyro is not None
        self.rate_squared = EXPECTED_SQUARED
        """Mean of the normalised innovation squared of the gyroscope's readings."""
        self._gyro_noise, self._stated_rate_rad_s = BinNoise(), 0.0 if gyro is None else gyro.noise_rad_s or 0.0
        self.newest_s: float | None = None
        self.outliers = 0
        self._bin_s, self._noise_g = bin_s, noise_g
        self._noise = BinNoise()
        self._evidence: deque[float] = deque(maxlen=EVIDENCE_BINS)
        self._force_evidence: deque[float] = deque(maxlen=COMPARED_BINS)
        self._mean_squared = EXPECTED_SQUARED
        self._first_line_rate_1_s: float | None = None
        self._doubtful_s = 0.0
        """How long something has acted that is not expected to act for long."""

    def steps_to(self, time_s: float) -> int:
        """Return the number of steps through a gap, up to a bin before a time; 0: there is none.

        They are longer than a bin: a gap of a minute is no reason for an update that takes a second.
        """
        if self.newest_s is None:
            return 0
        gap_bins = (time_s - self.newest_s) / self._bin_s - 1
        return max(0, math.ceil(gap_bins / BRIDGING_BINS - 0.2))

    @np.errstate(over="ignore", invalid="ignore")  # an account that diverges is broken, and made anew
    def bridge(self, time_s: float, steps: int) -> None:
        """Make the next steps towards a time without readings."""
        if self.newest_s is None or steps == 0:
            return
        self._noise.clear()
        step_s = (time_s - self._bin_s - self.newest_s) / self.steps_to(time_s)
        for begin in range(0, steps, STEPS_PER_EXCHANGE):
            together = min(STEPS_PER_EXCHANGE, steps - begin)
            self.filter.exchange(together * step_s)
            for _ in range(together):
                self.filter.advance(step_s)
        self.newest_s += steps * step_s

    @np.errstate(over="ignore", invalid="ignore")
    def take(self, one: ForceBin) -> None:
        """Take the next bin; what is left of a gap before it is bridged in one step."""
        if self.newest_s is not None:
            self.filter.predict(one.time_s - self.newest_s)
        self.newest_s = one.time_s
        if not one.is_usable:
            self._noise.clear()
            self._take_rate(one)
            return
        self._noise.add(self._without_line(one.force_g))
        self.outliers += self.filter.update(one.force_g, self._noise.sigma_g(self._stated_g(one.count)))
        self._force_evidence.append(self.filter.log_evidence)
        self._take_rate(one)
        self._evidence.append(self.filter.log_evidence)
        self._doubtful_s = self._doubtful_s + self._bin_s if self._acts() else 0.0
        squared = min(self.filter.squared_innovation, 10 * POOR_SQUARED)
        self._mean_squared += (1 - INNOVATION_MEMORY) * (squared - self._mean_squared)

    def _take_rate(self, one: ForceBin) -> None:
        """Take the reading of the gyroscope."""
        if not self.has_gyro or one.rate_rad_s is None or self.is_broken:
            return
        self._gyro_noise.add(one.rate_rad_s)
        if not self._gyro_noise.is_known:
            return
        sigma_rad_s = self._gyro_noise.sigma_g(self._stated_rate_rad_s / math.sqrt(one.count))
        squared = min(self.filter.update_rate(one.rate_rad_s, sigma_rad_s), 10 * POOR_SQUARED)
        self.rate_squared += (1 - INNOVATION_MEMORY) * (squared - self.rate_squared)

    def follow_line(self, found: FastOscillation | None) -> None:
        """Model the fast oscillation that was found."""
        if found is not None:
            if self._first_line_rate_1_s is None:
                self._first_line_rate_1_s = found.rate_1_s
            self.filter.begin_line(found.rate_1_s, found.amplitude_g)
        elif self.filter.line_rate_1_s is not None:
            self.filter.end_line()
            self._first_line_rate_1_s = None

    def misses_line(self, found: FastOscillation | None) -> bool:
        """Return whether a fast oscillation is not part of this account, or began in it with a wrong frequency."""
        if found is None:
            return False
        first = self._first_line_rate_1_s
        return first is None or abs(found.rate_1_s / first - 1) > LINE_TOLERANCE

    def evidence(self, bins: int) -> float:
        """Return the log evidence of the newest bins."""
        return sum(list(self._evidence)[-bins:])

    @property
    def force_evidence(self) -> float:
        """Log evidence of the accelerometer's newest readings, without those of a gyroscope."""
        return sum(self._force_evidence)

    def _acts(self) -> bool:
        """Return whether a drive or a gust goes on, or a hoist without speed."""
        mixture = self.filter.mixture
        driven, gust, hoisting = probabilities(mixture.weight)
        idle_hoist = hoisting > 0.5 and abs(float(mixture.weight @ mixture.state[:, HOIST_SPEED])) < SLOW_HOIST_M_S
        return idle_hoist or driven + gust > 0.5

    @property
    def is_broken(self) -> bool:
        """The account has lost its numbers; it must be made anew."""
        return not math.isfinite(float(self.filter.mixture.weight.sum()))

    @property
    def is_locked(self) -> bool:
        """A free swing on a rope of constant length explains the newest bins."""
        return bool(self.filter.mixture.weight[MotionHypothesis.FREE] > LOCKED_WEIGHT)

    @property
    def is_doubtful(self) -> bool:
        """The account does not explain the readings, or only by what no crane does."""
        mixture = self.filter.mixture
        velocity_m_s = (mixture.weight @ mixture.state[:, PIVOT_VELOCITY]).tolist()
        pivot_g = ((mixture.weight * PIVOT_SIGN) @ mixture.state[:, INPUT]).tolist()
        return (
            self._mean_squared > POOR_SQUARED
            or self._doubtful_s > LONGEST_ACT_S
            or math.hypot(*velocity_m_s) > IMPLAUSIBLE_SPEED_M_S
            or math.hypot(*pivot_g) > IMPLAUSIBLE_ACCELERATION_G
        )

    @property
    def sigma_g(self) -> Array:
        """Standard deviation of a bin, shape (3,)."""
        return self._noise.sigma_g(0.0)

    def _stated_g(self, count: int) -> float:
        if self._noise_g is None:
            return 0.0 if self._noise.is_known else UNKNOWN_NOISE_G / math.sqrt(count)
        return self._noise_g / math.sqrt(count)

    def _without_line(self, force_g: Array) -> Array:
        if self.filter.line_rate_1_s is None:
            return force_g
        mixture = self.filter.mixture
        found = force_g.copy()
        found[:2] -= mixture.weight @ mixture.state[:, LINE]
        return found
