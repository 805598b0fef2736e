"""Slow noise and thermal lag against closed forms and planted sessions."""

import numpy as np
import pytest

from gateway.bench.thermal.ramp import element_c
from gateway.bench.thermal.slow_noise import NoiseGrid, NoiseRatios, RecordingNoise, block_means
from gateway.numerics.array import Array

PLACE = (np.arange(40) + 0.5) / 40 - 0.5


def planted(random: np.random.Generator, drift: float) -> tuple[Array, Array]:
    """Return design and readings of six recordings with slope 2, white noise of 1 and a drift of this standard deviation."""
    design = np.cumsum(random.uniform(0, 1, (6, 40, 1)), axis=1)
    line = random.normal(0, drift, (6, 1)) * PLACE
    return design, 2 * design[..., 0] + random.normal(0, 50, (6, 1)) + random.standard_normal((6, 40)) + line


def test_blocks_hold_equally_many_rows() -> None:
    rows = np.arange(10.0)[:, None]
    np.testing.assert_allclose(block_means(rows, 4)[:, 0], [0.5, 3.0, 5.5, 8.0])
    np.testing.assert_allclose(block_means(rows, 10), rows)


def test_white_noise_alone_is_ordinary_least_squares() -> None:
    design, reading = planted(np.random.default_rng(1), 0.0)
    found = RecordingNoise(PLACE, NoiseRatios()).solve(design, reading, np.zeros(1))
    full = np.hstack([np.kron(np.eye(6), np.ones((40, 1))), design.reshape(-1, 1)])
    expected, rest, *_ = np.linalg.lstsq(full, reading.ravel(), rcond=None)
    np.testing.assert_allclose(found.values, expected)
    variance = float(rest[0]) / (240 - 7)
    assert found.covariance[-1, -1] == pytest.approx(variance * np.linalg.inv(full.T @ full)[-1, -1])


def test_a_variance_has_the_freedom_that_its_scatter_over_the_possible_ratios_leaves() -> None:
    noise = RecordingNoise(PLACE, NoiseRatios())
    design, reading = planted(np.random.default_rng(1), 0.0)
    row = np.eye(7)[-1]
    assert noise.solve(design, reading, np.zeros(1)).freedom_of(row) == pytest.approx(240 - 7)
    possible = [(0.5, noise), (0.5, RecordingNoise(PLACE, NoiseRatios(drift=100.0)))]
    found = RecordingNoise(PLACE, NoiseRatios(drift=50.0), possible).solve(design, reading, np.zeros(1))
    one, other = (row @ covariance @ row for _, covariance in found.possible)
    relative = (other - one) / (other + one)  # standard deviation over mean of two equally probable values
    assert found.freedom_of(row) == pytest.approx(1 / (relative**2 / 2 + 1 / (240 - 7)))
    assert found.coverage_factor(row) > 2


@pytest.mark.slow
@pytest.mark.parametrize("drift", [0.0, 10.0])
def test_intervals_hold_with_and_without_a_drift_that_looks_like_the_slope(drift: float) -> None:
    hits, widths = [], []
    for seed in range(60):
        design, reading = planted(np.random.default_rng(seed), drift)
        found = NoiseGrid(PLACE).estimate([(design, reading, np.zeros(1))])[0].solve(design, reading, np.zeros(1))
        row = np.eye(7)[-1]
        half = found.coverage_factor(row) * np.sqrt(found.covariance[-1, -1])
        hits.append(abs(found.values[-1] - 2) < half)
        widths.append(half)
    assert np.mean(hits) > 0.86
    assert (np.median(widths) > 0.15) == (drift > 0)


@pytest.mark.parametrize("lag_s", [-7.0, -0.2, 0.0, 0.2, 7.0])
def test_a_steady_ramp_is_moved_by_the_lag(lag_s: float) -> None:
    time_s = np.arange(0.0, 300.0, 0.5)
    found = element_c(time_s, 20 + 0.1 * time_s, lag_s)
    np.testing.assert_allclose(found[200:-1], 20 + 0.1 * (time_s + lag_s)[200:-1], atol=1e-6)


def test_a_thermometer_behind_a_first_order_lag_gives_the_element_back() -> None:
    time_s = np.arange(0.0, 300.0, 0.5)
    phase = 2 * np.pi * time_s / 100
    delay = 2 * np.pi * 4.0 / 100
    thermometer = np.cos(np.arctan(delay)) * np.sin(phase - np.arctan(delay))
    np.testing.assert_allclose(element_c(time_s, thermometer, 4.0)[5:-5], np.sin(phase)[5:-5], atol=1e-3)
    np.testing.assert_allclose(element_c(time_s, np.sin(phase), -4.0)[150:], thermometer[150:], atol=1e-3)
