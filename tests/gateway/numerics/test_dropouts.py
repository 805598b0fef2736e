"""Rows of zeros that stand for no reading."""

import numpy as np

from gateway.numerics.foreign_readings import find_dropouts


def swing_g(count: int = 400) -> np.ndarray:
    angle_rad = 0.5 * np.sin(0.1 * np.arange(count))
    return np.stack([np.sin(angle_rad), np.zeros(count), np.cos(angle_rad)], axis=1)


def test_zeros_between_readings_of_the_weight_are_missing() -> None:
    readings = swing_g()
    readings[[0, 50, 51, 200, 399]] = 0.0
    assert np.flatnonzero(find_dropouts(readings)).tolist() == [0, 50, 51, 200, 399]


def test_a_free_fall_through_coarse_steps_is_not_missing() -> None:
    readings = swing_g()
    readings[100:112] *= np.abs(np.linspace(-0.4, 0.4, 12))[:, None]
    readings = np.round(readings / 0.1) * 0.1
    assert (readings[100:112] == 0).all(axis=1).any()
    assert not find_dropouts(readings).any()


def test_zeros_in_every_tenth_row_are_no_lone_losses() -> None:
    readings = swing_g()
    readings[::10] = 0.0
    assert not find_dropouts(readings).any()
