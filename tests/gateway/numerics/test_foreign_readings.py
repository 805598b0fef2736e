"""The detection of readings that a slow sensor holds over several rows of its file, and of zeros that stand for no reading."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.numerics.foreign_readings import find_dropouts, find_fresh_rows

Array = NDArray[np.float64]


def swing_g(count: int, interval_s: float, step_g: float, noise_g: float = 0.002) -> Array:
    phase = 2 * np.pi * interval_s / 1.7 * np.arange(count)
    force_g = np.stack([0.2 * np.cos(phase), 0.05 * np.sin(phase), 1 - 0.03 * np.cos(2 * phase)], axis=1)
    force_g += np.random.default_rng(3).normal(0.0, noise_g, force_g.shape)
    return np.asarray(np.round(force_g / step_g) * step_g, dtype=np.float64)


@pytest.mark.parametrize("step_g", [1e-6, 0.016])
@pytest.mark.parametrize("rows_per_reading", [2.0, 3.0, 7.0, 20.0])
def test_each_reading_that_is_repeated_a_fixed_number_of_times_stays_once(
    step_g: float, rows_per_reading: float
) -> None:
    number = np.floor(np.arange(3000) / rows_per_reading).astype(int)
    readings_g = swing_g(int(number[-1]) + 1, 0.05, step_g)
    fresh = find_fresh_rows(readings_g[number])
    assert fresh is not None
    is_first = np.diff(number, prepend=-1) > 0
    assert not (fresh & ~is_first).any()
    new = np.concatenate([[True], (np.diff(readings_g, axis=0) != 0).any(axis=1)])
    assert fresh.sum() == new.sum()


@pytest.mark.parametrize("step_g", [1e-6, 0.004])
def test_a_rate_that_is_no_divisor_of_the_file_s_is_detected(step_g: float) -> None:
    number = np.floor(np.arange(3000) / 2.5).astype(int)
    fresh = find_fresh_rows(swing_g(1200, 0.05, step_g)[number])
    assert fresh is not None
    assert 1150 < fresh.sum() <= 1200


def test_fine_readings_that_are_repeated_irregularly_stay_once() -> None:
    repeats = np.random.default_rng(5).integers(1, 5, 800)
    fresh = find_fresh_rows(np.repeat(swing_g(800, 0.02, 1e-6), repeats, axis=0))
    assert fresh is not None
    assert fresh.sum() == 800


@pytest.mark.parametrize("noise_g", [0.0, 0.002, 0.02])
@pytest.mark.parametrize("rate_hz", [10.0, 100.0, 4000.0])
@pytest.mark.parametrize("step_g", [1e-6, 0.004, 0.016])
def test_a_sensor_as_fast_as_its_file_repeats_nothing(noise_g: float, rate_hz: float, step_g: float) -> None:
    assert find_fresh_rows(swing_g(8000, 1 / rate_hz, step_g, noise_g)) is None


def test_a_load_at_rest_in_coarse_steps_repeats_nothing() -> None:
    still_g = np.array([0.0, 0.0, 1.0]) + np.random.default_rng(1).normal(0.0, 0.002, (3000, 3))
    assert find_fresh_rows(np.asarray(np.round(still_g / 0.016) * 0.016, dtype=np.float64)) is None


def test_a_sensor_that_is_stuck_for_long_keeps_its_rows() -> None:
    readings_g = np.repeat(swing_g(500, 0.05, 1e-6), 3, axis=0)
    readings_g[600:900] = readings_g[600]
    fresh = find_fresh_rows(readings_g)
    assert fresh is not None
    assert fresh[600:900].all()


def planar_swing_g(count: int = 400) -> np.ndarray:
    angle_rad = 0.5 * np.sin(0.1 * np.arange(count))
    return np.stack([np.sin(angle_rad), np.zeros(count), np.cos(angle_rad)], axis=1)


def test_zeros_between_readings_of_the_weight_are_missing() -> None:
    readings = planar_swing_g()
    readings[[0, 50, 51, 200, 399]] = 0.0
    assert np.flatnonzero(find_dropouts(readings)).tolist() == [0, 50, 51, 200, 399]


def test_a_free_fall_through_coarse_steps_is_not_missing() -> None:
    readings = planar_swing_g()
    readings[100:112] *= np.abs(np.linspace(-0.4, 0.4, 12))[:, None]
    readings = np.round(readings / 0.1) * 0.1
    assert (readings[100:112] == 0).all(axis=1).any()
    assert not find_dropouts(readings).any()


def test_zeros_in_every_tenth_row_are_no_lone_losses() -> None:
    readings = planar_swing_g()
    readings[::10] = 0.0
    assert not find_dropouts(readings).any()
