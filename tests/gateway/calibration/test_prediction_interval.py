"""The permissible error of the magnitude against its closed form (Łuczak n.d., eq. 14)."""

import numpy as np
import pytest

from gateway.calibration.calibration_fit import prediction_interval_g

PER_G = 0.42
"""Volts per g."""


def interval_g(u_scale: float, u_offset_g: float, noise_g: float) -> float:
    covariance = np.zeros((12, 12))
    covariance[0, 0] = (u_scale / PER_G) ** 2  # of the first entry of the matrix alone
    covariance[9:, 9:] = (u_offset_g * PER_G) ** 2 * np.eye(3)
    return prediction_interval_g(np.eye(3) / PER_G, covariance, noise_g)


def test_it_is_three_standard_deviations_of_noise_offset_and_scale_together() -> None:
    assert interval_g(0.0, 0.0, 0.002) == pytest.approx(0.006)
    assert interval_g(0.0, 0.003, 0.0) == pytest.approx(0.009)
    assert interval_g(0.004, 0.0, 0.0) == pytest.approx(0.012)
    assert interval_g(0.004, 0.003, 0.012) == pytest.approx(3 * 0.013)
