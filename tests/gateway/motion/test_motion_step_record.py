"""The correction of a run by what came later: against the textbook smoother and against all paths of a Markov chain."""

from itertools import pairwise, product

import numpy as np
import pytest

from gateway.motion.mixture import Mixture
from gateway.motion.step_record import N_KEPT, Moments, StepHistory, StepRecord
from gateway.numerics.array import Array

STEPS, M = 12, 2
EXCHANGE = np.array([[0.9, 0.1], [0.3, 0.7]])


def alike(mean: Array, covariance: Array, weight: Array | None = None) -> Mixture:
    """The same under every hypothesis."""
    weight = np.full(M, 1 / M) if weight is None else weight
    return Mixture(np.tile(mean, (M, 1)), np.tile(covariance, (M, 1, 1)), weight)


def random_walk(seed: int) -> tuple[StepHistory, list[tuple[Array, Array]]]:
    """The steps of a Kalman filter on a linear Gaussian walk, and the states of the textbook smoother.

    Rauch, Tung and Striebel 1965: G = P F' (F P F' + Q)^-1.
    """
    rng = np.random.default_rng(seed)
    transition = np.eye(N_KEPT) + 0.1 * rng.normal(size=(N_KEPT, N_KEPT))
    root = rng.normal(size=(N_KEPT, N_KEPT))
    noise, observed = 0.1 * np.eye(N_KEPT) + 0.01 * root @ root.T, rng.normal(size=(3, N_KEPT))
    mean, covariance, history, filtered = np.zeros(N_KEPT), np.eye(N_KEPT), StepHistory(), []
    for step in range(STEPS + 1):
        gain = covariance @ observed.T @ np.linalg.inv(observed @ covariance @ observed.T + np.eye(3))
        mean = mean + gain @ (3 * rng.normal(size=3) - observed @ mean)
        covariance = covariance - gain @ observed @ covariance
        moved, spread = transition @ mean, transition @ covariance @ transition.T + noise
        filtered.append((mean, covariance, moved, spread))
        before = alike(mean, covariance)
        if step == STEPS:
            history.newest = (float(step), Moments.of(before))
            break
        transitions = np.tile(transition, (M, 1, 1))
        record = StepRecord.of(float(step), before, before, alike(moved, spread), transitions, np.eye(M))
        history.steps.append(record)
        mean, covariance = moved, spread
    smoothed = [filtered[-1][:2]]
    for mean, covariance, moved, spread in filtered[-2::-1]:
        gain = covariance @ transition.T @ np.linalg.inv(spread)
        later, later_covariance = smoothed[-1]
        smoothed.append((mean + gain @ (later - moved), covariance + gain @ (later_covariance - spread) @ gain.T))
    return history, smoothed[::-1]


@pytest.mark.parametrize("seed", range(5))
def test_corrected_states_of_a_linear_walk_are_those_of_the_textbook_smoother(seed: int) -> None:
    history, expected = random_walk(seed)

    found = history.smooth()

    assert [time_s for time_s, _ in found] == list(range(STEPS + 1))
    for (_, moments), (mean, covariance) in zip(found, expected, strict=True):
        np.testing.assert_allclose(moments.mean, mean, atol=1e-5)
        np.testing.assert_allclose(moments.covariance, covariance, atol=1e-5)


def test_oldest_steps_are_smoothed_by_all_later_ones_and_then_forgotten() -> None:
    history, _ = random_walk(1)
    whole, _ = random_walk(1)
    expected = whole.smooth()

    oldest, rest = history.smooth(5), history.smooth()

    assert [time_s for time_s, _ in oldest + rest] == [time_s for time_s, _ in expected]
    for (_, found), (_, other) in zip(oldest + rest, expected, strict=True):
        np.testing.assert_array_equal(found.mean, other.mean)
        np.testing.assert_array_equal(found.covariance, other.covariance)
    assert history.smooth() == []


def test_steps_between_two_bins_are_smoothed_and_not_told() -> None:
    history, expected = random_walk(2)
    step = history.steps[3]
    history.steps[3] = StepRecord(None, step.before, step.after, step.cross, step.exchange)

    found = history.smooth()

    assert [time_s for time_s, _ in found] == [0, 1, 2, *range(4, STEPS + 1)]
    np.testing.assert_allclose(found[0][1].mean, expected[0][0], atol=1e-5)


def test_what_comes_after_a_forgotten_motion_corrects_nothing_before_it() -> None:
    history, _ = random_walk(3)
    before = history.steps[4].before
    again = alike(np.zeros(N_KEPT), np.eye(N_KEPT))
    history.steps[4] = StepRecord.forgetting(4.0, alike(before.mean, before.covariance), again)

    found = dict(history.smooth())

    np.testing.assert_allclose(found[4.0].mean, before.mean)
    np.testing.assert_allclose(found[4.0].covariance, before.covariance)


def test_probabilities_of_the_hypotheses_are_those_over_all_paths() -> None:
    rng = np.random.default_rng(4)
    likelihood = rng.uniform(0.05, 1.0, size=(5, M))
    start = np.array([0.7, 0.3])
    mean, covariance, history, weight = np.zeros(N_KEPT), np.eye(N_KEPT), StepHistory(), start
    for step, seen in enumerate(likelihood):
        weight = weight * seen / (weight @ seen)
        before = alike(mean, covariance, weight)
        if step == len(likelihood) - 1:
            history.newest = (float(step), Moments.of(before))
            break
        after = alike(mean, covariance, weight @ EXCHANGE)
        stays = np.tile(np.eye(N_KEPT), (M, 1, 1))
        history.steps.append(StepRecord.of(float(step), before, before, after, stays, EXCHANGE))
        weight = weight @ EXCHANGE

    found = np.array([moments.weight for _, moments in history.smooth()])

    expected = np.zeros((len(likelihood), M))
    for path in product(range(M), repeat=len(likelihood)):
        chance = start[path[0]] * np.prod([EXCHANGE[a, b] for a, b in pairwise(path)])
        chance *= np.prod(likelihood[np.arange(len(path)), path])
        expected[np.arange(len(path)), path] += chance
    np.testing.assert_allclose(found, expected / expected.sum(axis=1, keepdims=True), rtol=1e-9)
