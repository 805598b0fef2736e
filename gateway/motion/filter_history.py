"""The run of a motion filter over bins, forward or backward in time, with the state at every bin.

Backward, the equations are the same with time reversed: direction, forces and accelerations stay; every first derivative, the
damping and the housing's rate about the rope change sign.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gateway.motion.binning import ForceBin
from gateway.motion.fast_oscillation import FastOscillation
from gateway.motion.filter_run import FilterRun
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.hypotheses import INITIAL_WEIGHTS
from gateway.motion.initial_state import Constants
from gateway.motion.mixing import Mixture
from gateway.motion.motion_filter import LINE_WALK, MotionFilter
from gateway.motion.motion_tracker import MotionTracker
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    GYRO_BIAS,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    LINE_RATE,
    LN_LENGTH,
    MOUNT,
    N_GYRO_STATES,
    N_STATES,
    OFFSET,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
)
from gateway.motion.whitening import with_share_of_information
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing

_PAIRS = (GRAVITY, RATE, INPUT, INPUT_RATE, SIDE_FORCE, OFFSET, MOUNT)
KEPT = [
    *(state for pair in _PAIRS for state in range(pair.start, pair.stop)),
    *(AXIAL_OFFSET, LN_LENGTH, HOIST_SPEED, HOIST_ACCELERATION, DAMPING, PLACE, SPIN),
]
"""States that both directions estimate. Left out: the fast oscillation, and the pivot's velocity, which counts from a rest."""
KEPT_GRAVITY, KEPT_RATE, KEPT_INPUT, KEPT_SIDE_FORCE = slice(0, 2), slice(2, 4), slice(4, 6), slice(8, 10)
KEPT_LN_LENGTH, KEPT_HOIST_SPEED = KEPT.index(LN_LENGTH), KEPT.index(HOIST_SPEED)


CONSTANTS = [
    *(state for pair in (SIDE_FORCE, OFFSET, MOUNT) for state in range(pair.start, pair.stop)),
    *(AXIAL_OFFSET, DAMPING, PLACE),
]
"""States that change little in a recording."""
KEPT_CONSTANTS = [KEPT.index(state) for state in CONSTANTS]
SIDE_FORCE_WALK = 2e-4
"""Random walk of the steady side force per weight over a whole recording, 1/sqrt(s). Basis: a wind that leans the load by 0.1
degrees in a minute. Two directions that take a changing force for constant both take its lean for a tilt of the mount."""
KEPT_SHARE = 1 / 16
"""Share of its information with which a run that turns begins again: standard deviations are four times as large."""


def _time_reversal_sign() -> Array:
    sign = np.ones(N_STATES + N_GYRO_STATES)
    for states in (RATE, INPUT_RATE, PIVOT_VELOCITY, LINE_RATE, GYRO_BIAS):
        sign[states] = -1.0
    sign[[HOIST_SPEED, DAMPING, SPIN]] = -1.0
    return sign


REVERSAL_SIGN = _time_reversal_sign()
"""Factor of each state under reversal of time."""


def reverse_time(mixture: Mixture) -> Mixture:
    """Return the same motion with time reversed."""
    sign = REVERSAL_SIGN[: mixture.state.shape[1]]
    return Mixture(mixture.state * sign, mixture.covariance * np.multiply.outer(sign, sign), mixture.weight)


@dataclass(frozen=True, slots=True)
class MixtureSeries:
    """A mixture of the kept states at each bin."""

    state: Array
    """Shape (n, m, k): bins, hypotheses, kept states."""
    covariance: Array
    """Shape (n, m, k, k)."""
    weight: Array
    """Shape (n, m)."""


def kept_states(mixture: Mixture) -> Mixture:
    """Return the mixture of the kept states."""
    return Mixture(mixture.state[:, KEPT], mixture.covariance[:, KEPT][:, :, KEPT], mixture.weight)


def stack(mixtures: Sequence[Mixture]) -> MixtureSeries:
    """Return the mixtures of consecutive bins as arrays."""
    return MixtureSeries(
        np.array([one.state for one in mixtures]),
        np.array([one.covariance for one in mixtures]),
        np.array([one.weight for one in mixtures]),
    )


class _KeptFilter(MotionFilter):
    """A filter that keeps its last prediction."""

    def __init__(
        self, model: RopeModel, constants: Constants, change: Callable[[Mixture], Mixture], gyro: GyroPrior | None
    ) -> None:
        super().__init__(model, constants, gyro)
        self._noise[:, SIDE_FORCE] = SIDE_FORCE_WALK**2
        self.mixture = self.predicted = change(self.mixture)

    def predict(self, time_s: float) -> None:
        super().predict(time_s)
        self.predicted = self.mixture


class _KeptRun(FilterRun):
    """A run that keeps a mixture for each bin."""

    def __init__(
        self,
        motion_filter: _KeptFilter,
        bin_s: float,
        noise_g: float | None,
        choose: Callable[[_KeptFilter], Mixture],
        gyro: GyroPrior | None,
    ) -> None:
        super().__init__(motion_filter, bin_s, noise_g, gyro)
        self.kept: list[Mixture] = []
        self.log_evidence: list[float] = []
        self._kept_filter, self._choose = motion_filter, choose

    def take(self, one: ForceBin) -> None:
        super().take(one)
        self.kept.append(self._choose(self._kept_filter))
        self.log_evidence.append(self.filter.log_evidence if one.is_usable else 0.0)


class FilterHistory(MotionTracker):
    """The live tracker over bins in either direction of time, with a state at each of them.

    Forward it is the state after the bin, backward that before it: what the later bins say. A run that continues another one in
    the opposite direction begins with the end of that one, widened so much that it counts for next to nothing, but that a motion
    at the beginning is not taken for another one. A second account begins with its constants alone.
    """

    def __init__(
        self,
        rig: MountedHousing,
        *,
        mount_u_rad: float,
        noise_g: float | None = None,
        gyro: GyroPrior | None = None,
        is_backward: bool = False,
        turned: "FilterHistory | None" = None,
    ) -> None:
        """`is_backward`: takes the latest bin first; `turned`: the run in the opposite direction that this one continues."""
        self._is_backward = is_backward
        self._turned = None if turned is None else reverse_time(turned.mixture)
        super().__init__(rig, mount_u_rad=mount_u_rad, noise_g=noise_g, gyro=gyro)
        self._steps_left = sys.maxsize
        self.mixtures: list[Mixture] = []
        """Kept states at each bin taken."""
        self.log_evidence: list[float] = []
        """Logarithm of the probability density of each bin taken, given those before it in the direction of the run."""
        if turned is not None:
            self._continue(turned)

    @property
    def bin_s(self) -> float:
        """Width of the bins that it takes."""
        return self._bin_s

    @property
    def mixture(self) -> Mixture:
        """All states after the newest bin, in the direction of the run."""
        return self._run.filter.mixture

    def prior(self) -> Mixture:
        """Return the kept states before any bin."""
        return kept_states(super()._new_run().filter.mixture)

    def take(self, one: ForceBin) -> None:
        """Take the next bin; the bins that a second account has taken before it takes over are described by that account."""
        before = self._run
        self._take(_reversed(one) if self._is_backward else one)
        run = self._run
        if not isinstance(run, _KeptRun):
            raise TypeError("a run without history")
        if run is not before:
            replaced = slice(len(self.mixtures) + 1 - len(run.kept), None)
            del self.mixtures[replaced], self.log_evidence[replaced]
        self.mixtures += run.kept
        self.log_evidence += run.log_evidence
        run.kept, run.log_evidence = [], []

    def _continue(self, turned: "FilterHistory") -> None:
        before, first = turned._run.filter, self._run.filter
        if before.line_rate_1_s is not None:
            self._run.follow_line(FastOscillation(before.line_rate_1_s, before.line_walk / LINE_WALK))
        end = reverse_time(before.mixture)
        kept = with_share_of_information(kept_states(end), kept_states(self._fresh), KEPT_SHARE)
        state, covariance = end.state.copy(), np.zeros_like(end.covariance)
        others = [place for place in range(state.shape[1]) if place not in KEPT]
        covariance[:, others, others] = end.covariance[:, others, others] / KEPT_SHARE
        state[:, KEPT] = kept.state
        covariance[np.ix_(range(len(state)), KEPT, KEPT)] = kept.covariance
        first.mixture = Mixture(state, covariance, 0.5 * (end.weight + INITIAL_WEIGHTS))

    def _new_run(self) -> FilterRun:
        model = super()._new_run().filter.model
        kept_filter = _KeptFilter(model, self._constants, self._start, self._gyro)
        return _KeptRun(kept_filter, self._bin_s, self._noise_g, self._chosen, self._gyro)

    def _start(self, mixture: Mixture) -> Mixture:
        self._fresh = start = reverse_time(mixture) if self._is_backward else mixture
        if self._turned is None:
            return start
        kept = with_share_of_information(kept_states(self._turned), kept_states(start), KEPT_SHARE)
        state, covariance = start.state.copy(), start.covariance.copy()
        state[:, CONSTANTS], known = _constants_of(kept)
        covariance[:, CONSTANTS], covariance[:, :, CONSTANTS] = 0.0, 0.0
        covariance[np.ix_(range(len(state)), CONSTANTS, CONSTANTS)] = known
        return Mixture(state, covariance, start.weight)

    def _chosen(self, motion_filter: _KeptFilter) -> Mixture:
        if self._is_backward:
            return kept_states(reverse_time(motion_filter.predicted))
        return kept_states(motion_filter.mixture)


def _reversed(one: ForceBin) -> ForceBin:
    return replace(one, time_s=-one.time_s, rate_rad_s=None if one.rate_rad_s is None else -one.rate_rad_s)


def _constants_of(mixture: Mixture) -> tuple[Array, Array]:
    """Return mean and covariance of the constants in a mixture of the kept states."""
    state = mixture.state[:, KEPT_CONSTANTS]
    mean = mixture.weight @ state
    deviation = state - mean
    covariance = np.tensordot(mixture.weight, mixture.covariance[:, KEPT_CONSTANTS][:, :, KEPT_CONSTANTS], 1)
    return mean, covariance + (mixture.weight[:, None] * deviation).T @ deviation
