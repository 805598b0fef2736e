"""Quantiles, robust spread, runs and autocorrelation: against tables and known answers."""

import numpy as np
import pytest

from gateway.numerics.stats import (
    autocorrelations,
    chi_square_quantile,
    correlation_sum,
    normal_quantile,
    robust_sigma,
    student_quantile,
    true_runs,
)

GUM_TABLE_G2_95_PERCENT = {1: 12.71, 2: 4.30, 3: 3.18, 4: 2.78, 5: 2.57, 10: 2.23, 20: 2.09, 50: 2.01, 100: 1.984}


@pytest.mark.parametrize(("freedom", "factor"), GUM_TABLE_G2_95_PERCENT.items())
def test_student_quantiles_agree_with_the_table_of_the_gum(freedom: int, factor: float) -> None:
    assert student_quantile(0.975, freedom) == pytest.approx(factor, abs=0.006)


def test_student_quantile_approaches_the_normal_quantile() -> None:
    assert student_quantile(0.975, 1e7) == pytest.approx(normal_quantile(0.975), abs=1e-6)
    assert normal_quantile(0.975) == pytest.approx(1.959964, abs=1e-6)


@pytest.mark.parametrize(("freedom", "quantile"), [(1, 6.635), (3, 11.345), (10, 23.209), (100, 135.807)])
def test_chi_square_quantile_agrees_with_the_table(freedom: int, quantile: float) -> None:
    assert chi_square_quantile(0.99, freedom) == pytest.approx(quantile, rel=0.01)


def test_robust_sigma_resists_outliers() -> None:
    noise = np.random.default_rng(1).normal(scale=[1.0, 3.0], size=(20_000, 2))
    noise[:1000] = 1e6

    assert robust_sigma(noise) == pytest.approx([1.0, 3.0], rel=0.1)


def test_runs_are_half_open_intervals() -> None:
    assert true_runs([True, True, False, False, True]) == [(0, 2), (4, 5)]
    assert true_runs(np.zeros(3, dtype=bool)) == []
    assert true_runs([]) == []


def test_correlation_sum_of_a_first_order_process() -> None:
    rng, memory = np.random.default_rng(2), 0.8
    values = rng.normal(size=200_000)
    for i in range(1, len(values)):
        values[i] += memory * values[i - 1]

    assert correlation_sum(values) == pytest.approx((1 + memory) / (1 - memory), rel=0.05)
    assert correlation_sum(rng.normal(size=1000)) == 1.0


def test_a_constant_series_has_no_autocorrelation() -> None:
    assert list(autocorrelations(np.ones(10))) == []
    assert correlation_sum(np.ones(10)) == 1.0
