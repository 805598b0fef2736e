"""A candidate account: what it keeps over a gap, and how its constants return to what was stated."""

import numpy as np
import pytest

from gateway.motion.binning import Binning, ForceBin
from gateway.motion.candidate import FORGOTTEN_PERIODS, MotionCandidate
from gateway.motion.initial_state import Constants
from gateway.motion.mixture import Mixture
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    GRAVITY,
    LEVER,
    LN_LENGTH,
    MOUNT,
    OFFSET,
    PLACE,
    SIDE_FORCE,
    STIFFNESS,
    indices,
)
from gateway.motion.stated_values import RETURN_TIMES_S
from gateway.numerics.array import Array
from tests.gateway.motion.conftest import GRAVITY_M_S2, Recording

pytestmark = pytest.mark.slow

BIN_S, STATED_M = 0.2, 10.0
PERIOD_S = 2 * np.pi * np.sqrt(STATED_M / GRAVITY_M_S2)
SIGMA_G = np.full(3, 2e-4)
CONSTANTS = [
    i for states in (OFFSET, MOUNT, AXIAL_OFFSET, PLACE, LEVER, STIFFNESS, SIDE_FORCE) for i in indices(states)
]


def new_candidate() -> MotionCandidate:
    model = RopeModel(GRAVITY_M_S2, STATED_M, is_clamped=True)
    motion_filter = MotionFilter(model, Constants(STATED_M, 0.05, 5.0, 0.05, (3e-4, 3e-4, 3e-4), 1e-3))
    return MotionCandidate(motion_filter, BIN_S, PERIOD_S, None, "rope")


@pytest.fixture
def candidate(free_swing: Recording) -> MotionCandidate:
    """It has followed a free swing of forty seconds."""
    found = new_candidate()
    for one in Binning(BIN_S).add(free_swing.time_s, free_swing.force_g):
        found.take(one, SIGMA_G)
    return found


def wait(candidate: MotionCandidate, gap_s: float) -> tuple[Array, Array]:
    """Mean and covariance after a gap, before anything is read."""
    assert candidate.newest_s is not None
    candidate.take(ForceBin(candidate.newest_s + gap_s, np.full(3, np.nan), 1, is_clipped=True), SIGMA_G)
    return candidate.filter.mixture.moments()


def test_gap_that_is_too_long_for_the_motion_keeps_the_constants(candidate: MotionCandidate) -> None:
    before, before_covariance = candidate.filter.mixture.moments()

    after, covariance = wait(candidate, 1.01 * FORGOTTEN_PERIODS * PERIOD_S)

    prior, prior_covariance = new_candidate().filter.mixture.moments()
    block = np.ix_(CONSTANTS, CONSTANTS)
    np.testing.assert_allclose(after[CONSTANTS], before[CONSTANTS], atol=1e-12)
    np.testing.assert_allclose(covariance[block], before_covariance[block], atol=1e-12)
    assert after[LN_LENGTH] == pytest.approx(before[LN_LENGTH])
    assert np.abs(before[CONSTANTS] - prior[CONSTANTS]).max() > 1e-4
    np.testing.assert_allclose(after[GRAVITY], 0.0, atol=1e-12)
    np.testing.assert_allclose(covariance[GRAVITY, GRAVITY], prior_covariance[GRAVITY, GRAVITY])


def test_motion_goes_on_over_a_shorter_gap(candidate: MotionCandidate) -> None:
    """Half a period later the load hangs on the other side, less certainly."""
    before, before_covariance = candidate.filter.mixture.moments()
    length_m = np.exp(before[LN_LENGTH])

    after, covariance = wait(candidate, float(np.pi * np.sqrt(length_m / GRAVITY_M_S2)))

    np.testing.assert_allclose(after[GRAVITY], -before[GRAVITY], atol=0.1 * np.hypot(*before[GRAVITY]) + 1e-3)
    assert np.trace(covariance[GRAVITY, GRAVITY]) > np.trace(before_covariance[GRAVITY, GRAVITY])


def test_constants_return_to_what_was_stated() -> None:
    """Exponentially in the time of each, mean and variance, while nothing is read."""
    motion_filter = new_candidate().filter
    prior, duration_s, step_s = motion_filter.prior, 40.0, 0.5
    state, covariance = prior.state.copy(), prior.covariance.copy()
    sigma = np.sqrt(np.diagonal(prior.covariance, axis1=1, axis2=2))
    state[:, CONSTANTS] += 0.5 * sigma[:, CONSTANTS]
    state[:, indices(SIDE_FORCE)] = 1e-3
    covariance *= 0.01
    motion_filter.mixture = Mixture(state, covariance, prior.weight)

    for _ in range(round(duration_s / step_s)):
        motion_filter.predict(step_s)

    found, variance = motion_filter.mixture.state[0], np.diagonal(motion_filter.mixture.covariance[0])
    for states, return_s in RETURN_TIMES_S:
        factor = np.exp(-duration_s / return_s)
        mean = prior.state[0, states] + factor * (state[0, states] - prior.state[0, states])
        if states == SIDE_FORCE:  # a turbulent wind changes it, too, and what was held and let go forgets it
            np.testing.assert_allclose(found[states], mean, rtol=0.03)
        else:
            np.testing.assert_allclose(found[states], mean, atol=1e-12)
            expected = np.square(sigma[0, states]) * (1 - 0.99 * factor**2)
            np.testing.assert_allclose(variance[states], expected, rtol=1e-9)


def test_readings_that_the_candidate_does_not_expect_are_evidence_against_it(free_swing: Recording) -> None:
    """A step of the reading of one second, as no rope makes it."""
    candidate, other = new_candidate(), new_candidate()
    for one in Binning(BIN_S).add(free_swing.time_s, free_swing.force_g):
        candidate.take(one, SIGMA_G)
        force_g = one.force_g + np.array([0.03, 0.0, 0.0]) if 35.0 < one.time_s < 36.0 else one.force_g
        other.take(ForceBin(one.time_s, force_g, one.count, one.is_clipped), SIGMA_G)

    assert other.evidence < candidate.evidence - 1.0
