"""Moments of a mixture against draws, and what an exchange of probability keeps."""

import numpy as np
import pytest

from gateway.motion.disturbances import DisturbanceStep
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.mixture import Ending, Mixture, Renewal, exchange

N = 4
SEEDS = range(5)
NO_ENDING, NO_RENEWAL = Ending((), 0, 1.0), Renewal((), slice(0, 1), np.array([]))


def random_mixture(rng: np.random.Generator) -> Mixture:
    root = rng.normal(size=(N_HYPOTHESES, N, N))
    return Mixture(
        rng.normal(size=(N_HYPOTHESES, N)),
        root @ root.transpose(0, 2, 1),
        rng.dirichlet(np.ones(N_HYPOTHESES)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_moments_are_those_of_draws(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mixture = random_mixture(rng)
    which = rng.choice(N_HYPOTHESES, size=100_000, p=mixture.weight)
    roots = np.linalg.cholesky(mixture.covariance)
    draws = mixture.state[which] + np.matvec(roots[which], rng.normal(size=(len(which), N)))

    mean, covariance = mixture.moments()

    scale = np.sqrt(np.diagonal(covariance))
    np.testing.assert_allclose(draws.mean(axis=0) / scale, mean / scale, atol=0.02)
    np.testing.assert_allclose(np.cov(draws.T) / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=0.05)


@pytest.mark.parametrize("seed", SEEDS)
def test_exchange_keeps_overall_mean_and_covariance(seed: int) -> None:
    """Nothing has moved yet: only what each hypothesis takes for granted has changed."""
    mixture = random_mixture(np.random.default_rng(seed))

    after, share, _ = exchange(mixture, DisturbanceStep.of(0.5).exchange, NO_ENDING, NO_RENEWAL)

    assert after.weight.sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(share.sum(axis=1), 1.0, atol=1e-12)
    for found, expected in zip(after.moments(), mixture.moments(), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_exchange_of_equal_states_changes_weights_alone() -> None:
    rng = np.random.default_rng(1)
    one = random_mixture(rng)
    mixture = Mixture(
        np.tile(one.state[0], (N_HYPOTHESES, 1)), np.tile(one.covariance[0], (N_HYPOTHESES, 1, 1)), one.weight
    )
    transition = DisturbanceStep.of(2.0).exchange

    after, share, _ = exchange(mixture, transition, NO_ENDING, NO_RENEWAL)

    np.testing.assert_allclose(after.state, mixture.state, atol=1e-14)
    np.testing.assert_allclose(after.covariance, mixture.covariance, atol=1e-13)
    np.testing.assert_allclose(after.weight, mixture.weight @ transition)
    np.testing.assert_allclose(share.T @ after.weight, mixture.weight)


def test_without_an_exchange_everything_stays() -> None:
    mixture = random_mixture(np.random.default_rng(2))

    after, share, _ = exchange(mixture, np.eye(N_HYPOTHESES), NO_ENDING, NO_RENEWAL)

    np.testing.assert_allclose(after.state, mixture.state, atol=1e-14)
    np.testing.assert_allclose(after.covariance, mixture.covariance, atol=1e-13)
    np.testing.assert_allclose(after.weight, mixture.weight)
    np.testing.assert_allclose(share, np.eye(N_HYPOTHESES), atol=1e-14)


def two_hypotheses(speed: float, sigma: float) -> Mixture:
    """Return one that runs at a speed, and one that rests; the other state has moved with the speed."""
    root = np.array([[sigma, 0.0], [3 * sigma, 0.1]])
    running, resting = root @ root.T, np.diag([1e-4, 1.0])
    state = np.array([[speed, 1.0 + 3 * speed], [0.0, 1.0]])
    return Mixture(state, np.array([running, resting]), np.array([1.0, 1e-30]))


STOP = Ending(((np.array([0]), np.array([1])),), 0, 0.02**2)
OFTEN = np.array([[0.9, 0.1], [0.0, 1.0]])


def test_what_ends_is_conditioned_on_its_end_as_by_an_observation_of_zero() -> None:
    speed, sigma = 0.05, 0.12
    variance = sigma**2 + 0.02**2

    after, _, exchanged = exchange(two_hypotheses(speed, sigma), OFTEN, STOP, NO_RENEWAL)

    density_over_that_at_rest = 0.02 / np.sqrt(variance) * np.exp(-0.5 * speed**2 / variance)
    ended = 0.1 * density_over_that_at_rest
    assert after.weight == pytest.approx([0.9 / (0.9 + ended), ended / (0.9 + ended)])
    assert exchanged[0] == pytest.approx(after.weight)
    assert after.state[1] == pytest.approx([speed * 0.02**2 / variance, 1.0 + 3 * speed * 0.02**2 / variance])
    assert after.covariance[1, 0, 0] == pytest.approx(sigma**2 * 0.02**2 / variance)
    np.testing.assert_allclose(after.state[0], [speed, 1.0 + 3 * speed])


def test_what_runs_for_certain_does_not_end() -> None:
    after, _, _ = exchange(two_hypotheses(0.4, 0.02), OFTEN, STOP, NO_RENEWAL)

    assert after.weight[1] < 1e-20
    np.testing.assert_allclose(after.moments()[0], [0.4, 2.2])


def test_what_is_at_rest_ends_as_often_as_stated() -> None:
    after, _, _ = exchange(two_hypotheses(0.0, 1e-4), OFTEN, STOP, NO_RENEWAL)

    assert after.weight == pytest.approx([0.9, 0.1], rel=1e-4)


def test_what_follows_a_renewal_has_nothing_of_the_state_before() -> None:
    renewal = Renewal(((np.array([0]), np.array([1])),), slice(0, 1), np.array([0.3**2]))

    after, _, exchanged = exchange(two_hypotheses(0.4, 0.02), OFTEN, NO_ENDING, renewal)

    assert after.weight == pytest.approx([0.9, 0.1])
    assert exchanged[0] == pytest.approx([0.9, 0.1])
    np.testing.assert_allclose(after.state, [[0.4, 2.2], [0.0, 2.2]], atol=1e-12)
    np.testing.assert_allclose(after.covariance[1], np.diag([0.3**2, 9 * 0.02**2 + 0.1**2]), atol=1e-12)
