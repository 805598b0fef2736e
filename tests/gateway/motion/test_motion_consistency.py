"""Statistics of the filter on data that its own model draws: innovations and intervals have the stated size."""

import numpy as np
import pytest

from gateway.motion.hypotheses import N_HYPOTHESES, MotionHypothesis
from gateway.motion.initial_state import Constants
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import GRAVITY, RATE
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.gateway.motion.conftest import GRAVITY_M_S2

BIN_S, BINS, RUNS = 0.1, 50, 80
NOISE_G = 1e-3
"""Of a bin; the filter's allowance for what its equations leave out is small beside it."""
FREE = MotionHypothesis.FREE


def free_run(seed: int) -> tuple[Array, Array]:
    """Normalised innovations squared of a free swing drawn from the filter's own prior, and errors over uncertainties."""
    rng = np.random.default_rng(seed)
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)
    length_m = rng.uniform(6, 15)
    constants = Constants(length_m, 0.05, 0.5 * length_m, 0.02, (5e-4, 5e-4, 5e-4), 1e-3)
    motion_filter = MotionFilter(model, constants)
    mixture = motion_filter.mixture
    x = np.tile(rng.multivariate_normal(mixture.state[FREE], mixture.covariance[FREE]), (N_HYPOTHESES, 1))
    squared, errors = [], []
    for number in range(BINS):
        x = advance(model, x)
        reading = model.reading(x)[0][FREE] + NOISE_G * rng.normal(size=3)
        motion_filter.predict(BIN_S)
        motion_filter.update(reading, np.full(3, NOISE_G))
        squared.append(motion_filter.squared_innovation)
        if number % 25 == 24:
            errors.append(normalised_errors(motion_filter, x[FREE]))
    return np.array(squared), np.array(errors)


def advance(model: RopeModel, x: Array) -> Array:
    """Return the states one bin later, by two midpoint steps."""
    for _ in range(2):
        half = x + BIN_S / 4 * model.rate(x)[0]
        x = x + BIN_S / 2 * model.rate(half)[0]
    return x


def normalised_errors(motion_filter: MotionFilter, truth: Array) -> Array:
    """Of angle and rate, both components."""
    states = [*range(GRAVITY.start, RATE.stop)]
    mixture = motion_filter.mixture
    mean = mixture.weight @ mixture.state[:, states]
    deviation = mixture.state[:, states] - mean
    variances = np.diagonal(mixture.covariance, axis1=1, axis2=2)[:, states] + deviation**2
    errors: Array = (mean - truth[states]) / np.sqrt(mixture.weight @ variances)
    return errors


@pytest.fixture(scope="module")
def runs() -> tuple[Array, Array]:
    squared, errors = zip(*(free_run(seed) for seed in range(RUNS)), strict=True)
    return np.concatenate(squared), np.concatenate(errors)


def test_mean_normalised_innovation_squared_is_three_less_the_allowance_for_the_model(
    runs: tuple[Array, Array],
) -> None:
    """The filter allows for errors of its equations (MODEL_SHARE) that these data do not have: up to a tenth of the variance."""
    squared, _ = runs
    chance = 4 * np.sqrt(6 / len(squared))

    assert 0.9 * 3.0 - chance < squared.mean() < 3.0 + chance


def test_intervals_of_angle_and_rate_hold_as_often_as_stated(runs: tuple[Array, Array]) -> None:
    """Too wide at the beginning, where a drive is not excluded yet that these data never have; never too narrow."""
    _, errors = runs

    assert (np.abs(errors) < NORMAL_975).mean() > 0.93
    assert np.sqrt((errors**2).mean()) > 0.4
