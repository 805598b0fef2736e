"""Levels of pivot, wind and hoist: each keeps its own size, and a hypothesis is followed by others."""

from itertools import product

import numpy as np
import pytest

from gateway.motion.disturbances import SMALLEST_RATE_1_S, STILL_ACCELERATION_M_S2, DisturbanceStep
from gateway.motion.hypotheses import (
    ABRUPT,
    CALM,
    CHANGING,
    DRIVEN,
    FLOATING,
    FLOATING_DRIVEN,
    FLOATING_SHARE,
    HEAVE_SIGMA,
    HELD,
    INITIAL_WEIGHTS,
    IS_DRIVEN,
    IS_FLOATING,
    IS_FREE,
    IS_GUST,
    IS_HOISTING,
    N_HYPOTHESES,
    PIVOT_LEVEL,
    PIVOT_LEVELS,
    RESTING,
    STILL,
    TURBULENT,
    WINCH_LEVEL,
    WIND_LEVEL,
    WIND_LEVELS,
    YIELDING,
    initial_weights,
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
    """Its standard deviation, and that of its derivative: the natural frequency times as large; next to none of an abrupt one."""
    step = DisturbanceStep.of(time_s)
    pivot = carried(step.pivot, time_s)
    rates_1_s = [SMALLEST_RATE_1_S if one.is_abrupt else one.rate_1_s for one in PIVOTS]
    size = np.array(
        [np.diag([one.sigma**2, (rate_1_s * one.sigma) ** 2]) for one, rate_1_s in zip(PIVOTS, rates_1_s, strict=True)]
    )

    after = pivot @ size @ pivot.transpose(0, 2, 1) + step.pivot_noise

    np.testing.assert_allclose(after, size, rtol=1e-9, atol=1e-16)
    assert np.linalg.eigvalsh(step.pivot_noise).min() > -1e-15


@any_time
def test_gust_heave_and_resting_winch_keep_their_sizes_on_every_level(time_s: float) -> None:
    step = DisturbanceStep.of(time_s)
    gust, heave = np.array([one.sigma for one in WINDS]), carried(step.heave, time_s)
    heave_size = np.array(
        [np.diag([sigma**2, (one.heave_rate_1_s * sigma) ** 2]) for one, sigma in zip(PIVOTS, HEAVE_SIGMA, strict=True)]
    )
    hoist = carried(step.hoist, time_s)[WINCH_LEVEL == RESTING]

    np.testing.assert_allclose(step.gust**2 * gust**2 + step.gust_noise, gust**2)
    after = heave @ heave_size @ heave.transpose(0, 2, 1) + step.heave_noise
    np.testing.assert_allclose(after, heave_size, rtol=1e-9, atol=1e-16)
    rests = hoist[:, 1, 1] ** 2 * STILL_ACCELERATION_M_S2**2 + step.hoist_noise[WINCH_LEVEL == RESTING, 1, 1]
    np.testing.assert_allclose(rests, STILL_ACCELERATION_M_S2**2)


@any_time
def test_two_steps_of_a_time_are_one_of_twice_the_time(time_s: float) -> None:
    once, twice = DisturbanceStep.of(time_s), DisturbanceStep.of(2 * time_s)
    pivot, heave = carried(once.pivot, time_s), carried(once.heave, time_s)
    hoist = carried(once.hoist, time_s)[WINCH_LEVEL == CHANGING]

    np.testing.assert_allclose(pivot @ pivot, carried(twice.pivot, 2 * time_s), atol=1e-12)
    np.testing.assert_allclose(
        pivot @ once.pivot_noise @ pivot.transpose(0, 2, 1) + once.pivot_noise, twice.pivot_noise, atol=1e-15
    )
    np.testing.assert_allclose(hoist @ hoist, carried(twice.hoist, 2 * time_s)[WINCH_LEVEL == CHANGING], atol=1e-12)
    np.testing.assert_allclose(once.gust**2, twice.gust)
    np.testing.assert_allclose((1 + once.gust**2) * once.gust_noise, twice.gust_noise)
    np.testing.assert_allclose(heave @ heave, carried(twice.heave, 2 * time_s), atol=1e-12)
    np.testing.assert_allclose(
        heave @ once.heave_noise @ heave.transpose(0, 2, 1) + once.heave_noise, twice.heave_noise, atol=1e-15
    )


def test_pivot_follows_the_equation_of_its_oscillator() -> None:
    """x'' = -2 z r x' - r^2 x, by differences of a short step; an abrupt one follows x' = -r x."""
    time_s = 1e-6
    rate = (carried(DisturbanceStep.of(time_s).pivot, time_s) - np.eye(2)) / time_s

    for found, one in zip(rate, PIVOTS, strict=True):
        if one.is_abrupt:
            assert found[0, 0] == pytest.approx(-one.rate_1_s, abs=2e-4)
        else:
            expected = [[0.0, 1.0], [-(one.rate_1_s**2), -2 * one.damping_ratio * one.rate_1_s]]
            np.testing.assert_allclose(found, expected, atol=2e-4)


def test_an_abrupt_acceleration_changes_at_once_and_a_smooth_one_does_not() -> None:
    """Within a bin of 0.3 s: a brake of 20 mg is within two standard deviations, and beyond six of a gentle ramp."""
    noise = np.sqrt(DisturbanceStep.of(0.3).pivot_noise[:, 0, 0])

    assert noise[PIVOT_LEVEL == ABRUPT].min() > 0.01
    assert noise[PIVOT_LEVEL == DRIVEN].max() < 0.0033


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

    assert (changes[follows] == 1).all()
    reached = np.linalg.matrix_power(follows.astype(float) + np.eye(N_HYPOTHESES), N_HYPOTHESES) > 0
    np.testing.assert_array_equal(reached, IS_FLOATING[:, None] == IS_FLOATING)  # a base floats or it does not


@pytest.mark.parametrize("floats", [False, True])
def test_the_first_weights_are_those_of_one_base(floats: bool) -> None:
    weight = initial_weights(floats=floats)

    share = FLOATING_SHARE if floats else 1 - FLOATING_SHARE
    of_base = floats == IS_FLOATING
    np.testing.assert_allclose(weight[of_base], INITIAL_WEIGHTS[of_base] / share)
    assert 0 < weight[~of_base].max() < 1e-100


def test_hypotheses_are_the_combinations_of_levels_that_readings_can_tell_apart() -> None:
    found = set(zip(PIVOT_LEVEL.tolist(), WIND_LEVEL.tolist(), WINCH_LEVEL.tolist(), strict=True))

    on_land = set(product(range(FLOATING), (CALM, TURBULENT), range(3)))
    at_sea = set(product((FLOATING, FLOATING_DRIVEN), (CALM,), range(3)))
    yields_in_a_wind = set(product((YIELDING,), (TURBULENT,), range(3)))
    assert found == (on_land - yields_in_a_wind) | at_sea | {(STILL, HELD, RESTING), (STILL, HELD, CHANGING)}
    assert len(found) == N_HYPOTHESES
    np.testing.assert_array_equal(IS_DRIVEN, np.isin(PIVOT_LEVEL, (DRIVEN, ABRUPT, FLOATING, FLOATING_DRIVEN)))
    np.testing.assert_array_equal(IS_FREE, ~(IS_DRIVEN | IS_GUST | IS_HOISTING))
    assert INITIAL_WEIGHTS.sum() == pytest.approx(1.0)
    assert (INITIAL_WEIGHTS > 0).all()


def test_a_hoist_counts_beside_a_drive_and_a_gust_counts_alone() -> None:
    weight = np.zeros(N_HYPOTHESES)
    weight[IS_DRIVEN & IS_GUST & IS_HOISTING] = 0.5

    assert probabilities(weight / weight.sum()) == pytest.approx((1.0, 0.0, 1.0))
    assert probabilities(IS_FREE / IS_FREE.sum()) == pytest.approx((0.0, 0.0, 0.0))
