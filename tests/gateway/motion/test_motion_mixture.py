"""Moments of a mixture against draws, and what an exchange of probability keeps."""

import numpy as np
import pytest

from gateway.motion.disturbances import DisturbanceStep
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.mixture import Mixture, exchange

N = 4
SEEDS = range(5)


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

    after, share = exchange(mixture, DisturbanceStep.of(0.5).exchange)

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

    after, share = exchange(mixture, transition)

    np.testing.assert_allclose(after.state, mixture.state, atol=1e-14)
    np.testing.assert_allclose(after.covariance, mixture.covariance, atol=1e-13)
    np.testing.assert_allclose(after.weight, mixture.weight @ transition)
    np.testing.assert_allclose(share.T @ after.weight, mixture.weight)


def test_without_an_exchange_everything_stays() -> None:
    mixture = random_mixture(np.random.default_rng(2))

    after, share = exchange(mixture, np.eye(N_HYPOTHESES))

    np.testing.assert_allclose(after.state, mixture.state, atol=1e-14)
    np.testing.assert_allclose(after.covariance, mixture.covariance, atol=1e-13)
    np.testing.assert_allclose(after.weight, mixture.weight)
    np.testing.assert_allclose(share, np.eye(N_HYPOTHESES), atol=1e-14)
