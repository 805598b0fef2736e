"""The filter's prediction: the derivatives of the equations of motion, and its steps from bin to bin."""

from collections.abc import Callable

import numpy as np
import pytest

from gateway.motion.initial_state import Constants
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import LONGEST_SHARE, SHORTEST_PER_PLACE, RopeModel
from gateway.motion.state_vector import (
    DAMPING,
    GRAVITY,
    GUST,
    HEAVE,
    HOIST_ACCELERATION,
    LEVER,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    PIVOT,
    PLACE,
    RATE,
    SIDE_FORCE,
)
from gateway.numerics.array import Array
from tests.gateway.motion.rope_states import (
    GRAVITY_M_S2,
    LENGTH_M,
    SEEDS,
    all_models,
    both_mountings,
    clamped,
    integrate_states,
    plain_state,
    random_states,
)


def central_differences(function: Callable[[Array], Array], x: Array) -> Array:
    """The derivative of rows by the states of the same row, shape (m, values, N_STATES)."""
    columns = []
    for state in range(N_STATES):
        step = np.zeros(N_STATES)
        step[state] = 1e-5
        columns.append((function(x + step) - function(x - step)) / 2e-5)
    return np.stack(columns, axis=-1)


@pytest.mark.slow
@all_models
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_rate_is_that_of_central_differences(seed: int, model: RopeModel) -> None:
    x = random_states(np.random.default_rng(seed), model)

    _, jacobian = model.rate(x)

    expected = central_differences(lambda moved: model.rate(moved)[0], x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-7, rtol=1e-6)


@pytest.mark.slow
@all_models
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_reading_is_that_of_central_differences(seed: int, model: RopeModel) -> None:
    x = random_states(np.random.default_rng(seed), model)
    if not model.on_spreader:
        x[:, LEVER] = 0.0  # what a lever of centimetres adds to the derivative by constants is left out

    _, jacobian, _ = model.reading(x)

    expected = central_differences(lambda moved: model.reading(moved)[0], x)
    np.testing.assert_allclose(jacobian, expected, atol=1e-7, rtol=1e-6)


@pytest.mark.slow
@both_mountings
@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_of_the_reading_beside_the_rope_by_the_motion_is_that_of_central_differences(
    seed: int, is_clamped: bool
) -> None:
    model = RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=is_clamped)
    x = random_states(np.random.default_rng(seed), model)

    _, jacobian, _ = model.reading(x)

    expected = central_differences(lambda moved: model.reading(moved)[0], x)
    for states in (GRAVITY, RATE, PIVOT, GUST, SIDE_FORCE, HEAVE, HOIST_ACCELERATION, PLACE, LEVER, MOUNT):
        np.testing.assert_allclose(jacobian[:, :, states], expected[:, :, states], atol=1e-7, rtol=1e-6)


def test_prediction_of_the_filter_follows_the_equations_from_bin_to_bin() -> None:
    """Prediction alone, without a reading."""
    length_m, bin_s = 9.0, 0.1
    model = clamped()
    motion_filter = MotionFilter(model, Constants(length_m, 0.05, 4.0, 0.05, (3e-4, 3e-4, 3e-4), 1e-3))
    mixture = motion_filter.mixture
    x = plain_state(0.15 + 0.02j, 0.03 - 0.05j, length_m, 4.0, mixture.state[0, DAMPING])
    exact = integrate_states(model, x, bin_s / 10, 10)[-1, 0]
    mixture.state[:] = x

    motion_filter.predict(bin_s)

    np.testing.assert_allclose(motion_filter.mixture.state[0, :4], exact[:4], atol=2e-6)


def test_states_beyond_the_domain_are_limited_to_it() -> None:
    x = plain_state(1.5 + 0.5j, 0j, 9.0, 4.0)
    x[0, LN_LENGTH], x[1, LN_LENGTH] = 50.0, -50.0
    model = clamped()

    model.keep_in_domain(x)

    assert (np.hypot(x[:, 0], x[:, 1]) < 1).all()
    assert np.isfinite(model.rate(x)[0]).all()
    assert np.isfinite(model.reading(x)[0]).all()
    np.testing.assert_allclose(x[:, 1] / x[:, 0], 1 / 3)
    np.testing.assert_allclose(np.exp(x[:3, LN_LENGTH]), [LONGEST_SHARE * LENGTH_M, SHORTEST_PER_PLACE * 4.0, 9.0])
