"""Levels of pivot, wind and hoist: each keeps its own size, and a hypothesis is followed by others."""

from itertools import product

import numpy as np
import pytest

from gateway.motion.disturbances import STILL_ACCELERATION_M_S2, DisturbanceStep
from gateway.motion.hypotheses import (
    CHANGING,
    DRIVEN,
    FLOATING,
    INITIAL_WEIGHTS,
    IS_DRIVEN,
    IS_FREE,
    IS_GUST,
    IS_HOISTING,
    N_HYPOTHESES,
    PIVOT_LEVEL,
    PIVOT_LEVELS,
    RESTING,
    WINCH_LEVEL,
    WIND_LEVEL,
    WIND_LEVELS,
    probabilities,
    starts_1_s,
)
from gateway.numerics.array import Array

TIMES_S = (0.02, 0.1, 0.5, 3.0)
PIVOTS, WINDS = [PIVOT_LEVELS[level] for level in PIVOT_LEVEL], [WIND_LEVELS[level] for level in WIND_LEVEL]
any_time = pytest.mark.parametrize("time_s", TIMES_S)


def carried(step: Array, time_s: float) -> Array:
    """The whole change of pairs that the equations of motion have carried by their own rates."""
    return step @ [[1.0, time_s], [0.0, 1.0]]


@any_time
def test_acceleration_of_the_pivot_keeps_its_size_on_every_level(time_s: float) -> None:
    """Its standard deviation, and that of its derivative: the natural frequency times as large."""
    step = DisturbanceStep.of(time_s)
    pivot = carried(step.pivot, time_s)
    size = np.array([np.diag([one.sigma**2, (one.rate_1_s * one.sigma) ** 2]) for one in PIVOTS])

    after = pivot @ size @ pivot.transpose(0, 2, 1) + step.pivot_noise

    np.testing.assert_allclose(after, size, rtol=1e-9, atol=1e-16)
    assert np.linalg.eigvalsh(step.pivot_noise).min() > -1e-15


@any_time
def test_gust_heave_and_resting_winch_keep_their_sizes_on_every_level(time_s: float) -> None:
    step = DisturbanceStep.of(time_s)
    gust, heave = np.array([one.sigma for one in WINDS]), np.array([one.heave_sigma for one in PIVOTS])
    hoist = carried(step.hoist, time_s)[WINCH_LEVEL == RESTING]

    np.testing.assert_allclose(step.gust**2 * gust**2 + step.gust_noise, gust**2)
    np.testing.assert_allclose(step.heave**2 * heave**2 + step.heave_noise, heave**2)
    rests = hoist[:, 1, 1] ** 2 * STILL_ACCELERATION_M_S2**2 + step.hoist_noise[WINCH_LEVEL == RESTING, 1, 1]
    np.testing.assert_allclose(rests, STILL_ACCELERATION_M_S2**2)


@any_time
def test_two_steps_of_a_time_are_one_of_twice_the_time(time_s: float) -> None:
    once, twice = DisturbanceStep.of(time_s), DisturbanceStep.of(2 * time_s)
    pivot, hoist = carried(once.pivot, time_s), carried(once.hoist, time_s)[WINCH_LEVEL == CHANGING]

    np.testing.assert_allclose(pivot @ pivot, carried(twice.pivot, 2 * time_s), atol=1e-12)
    np.testing.assert_allclose(
        pivot @ once.pivot_noise @ pivot.transpose(0, 2, 1) + once.pivot_noise, twice.pivot_noise, atol=1e-15
    )
    np.testing.assert_allclose(hoist @ hoist, carried(twice.hoist, 2 * time_s)[WINCH_LEVEL == CHANGING], atol=1e-12)
    np.testing.assert_allclose(once.gust**2, twice.gust)
    np.testing.assert_allclose((1 + once.gust**2) * once.gust_noise, twice.gust_noise)
    np.testing.assert_allclose(once.heave**2, twice.heave)
    np.testing.assert_allclose((1 + once.heave**2) * once.heave_noise, twice.heave_noise)


def test_pivot_follows_the_equation_of_its_oscillator() -> None:
    """x'' = -2 z r x' - r^2 x, by differences of a short step."""
    time_s = 1e-6
    pivot = carried(DisturbanceStep.of(time_s).pivot, time_s)

    rate = (pivot - np.eye(2)) / time_s

    expected = [[[0.0, 1.0], [-(one.rate_1_s**2), -2 * one.damping_ratio * one.rate_1_s]] for one in PIVOTS]
    np.testing.assert_allclose(rate, expected, atol=2e-4)


@any_time
def test_probabilities_of_an_exchange_sum_to_one(time_s: float) -> None:
    exchange = DisturbanceStep.of(time_s).exchange

    np.testing.assert_allclose(exchange.sum(axis=1), 1.0, atol=1e-12)
    assert exchange.min() >= 0
    assert (exchange.diagonal() > 0).all()


def test_hypotheses_follow_each_other_as_often_as_stated() -> None:
    time_s = 1e-6

    left = (DisturbanceStep.of(time_s).exchange - np.eye(N_HYPOTHESES)) / time_s

    starts = starts_1_s()
    np.testing.assert_allclose(left, starts - np.diag(starts.sum(axis=1)), atol=1e-5)


def test_one_thing_changes_at_a_time_and_every_hypothesis_is_reached() -> None:
    follows = starts_1_s() > 0
    levels = np.column_stack([PIVOT_LEVEL, WIND_LEVEL, WINCH_LEVEL])
    changes = (levels[:, None] != levels[None]).sum(axis=2)

    np.testing.assert_array_equal(follows, changes == 1)


def test_hypotheses_are_all_combinations_of_the_levels() -> None:
    found = set(zip(PIVOT_LEVEL.tolist(), WIND_LEVEL.tolist(), WINCH_LEVEL.tolist(), strict=True))

    assert found == set(product(range(len(PIVOT_LEVELS)), range(len(WIND_LEVELS)), range(3)))
    assert len(found) == N_HYPOTHESES
    np.testing.assert_array_equal(IS_DRIVEN, np.isin(PIVOT_LEVEL, (DRIVEN, FLOATING)))
    np.testing.assert_array_equal(IS_FREE, ~(IS_DRIVEN | IS_GUST | IS_HOISTING))
    assert INITIAL_WEIGHTS.sum() == pytest.approx(1.0)
    assert (INITIAL_WEIGHTS > 0).all()


def test_a_hoist_counts_beside_a_drive_and_a_gust_counts_alone() -> None:
    weight = np.zeros(N_HYPOTHESES)
    weight[IS_DRIVEN & IS_GUST & IS_HOISTING] = 0.5

    assert probabilities(weight / weight.sum()) == pytest.approx((1.0, 0.0, 1.0))
    assert probabilities(IS_FREE / IS_FREE.sum()) == pytest.approx((0.0, 0.0, 0.0))
