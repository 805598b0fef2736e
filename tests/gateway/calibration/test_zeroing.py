"""Zeroing in place: the mean afterwards, the covariance, and the readings that are refused."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from gateway.calibration.acceptance import make_record
from gateway.calibration.calibration_fit import CalibrationFit, FitWarning
from gateway.calibration.methods.zeroing import SUM_WARNING, zero_in_place, zeroing_rotation
from gateway.calibration.pose import RawReadings
from gateway.calibration.record import CalibrationError, CalibrationRecord, NotDeterminedError
from gateway.numerics.array import Array

STRAIGHT = np.eye(3)
X_UP = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # the sensor's x points up
UNITS_PER_G = 1000.0
U_OFFSET_G, U_ANGLE_RAD = 0.002, 0.005


def make_parent(gain: Array = STRAIGHT, u_deg: float = 0.5) -> CalibrationRecord:
    covariance = np.diag([(np.radians(u_deg) / UNITS_PER_G) ** 2] * 9 + [(U_OFFSET_G * UNITS_PER_G) ** 2] * 3)
    fit = CalibrationFit(
        method="six-position",
        offset=(20.0, -10.0, 5.0),
        correction_matrix=np.asarray(np.linalg.inv(gain) / UNITS_PER_G, dtype=np.float64),
        covariance=covariance,
        prediction_interval_g=0.05,
        poses=(),
        temperature_c=None,
        misalignment_deg={},
        residual_rms_g=0.0,
        condition_number=1.0,
        budget=(),
        warnings=(),
    )
    return make_record(
        fit, device_id="d", unit="counts", software="1", by="x", created_utc="2026-01-01T00:00:00Z", parent=None
    )


def hanging_readings(
    force_g: ArrayLike, seconds: float = 40.0, noise_g: float = 0.001, swing_g: float = 0.0
) -> RawReadings:
    random = np.random.default_rng(4)
    time_s = np.arange(round(seconds * 50)) / 50
    swing = swing_g * np.sin(2 * np.pi * 0.2 * time_s)
    raw = (np.asarray(force_g) + noise_g * random.standard_normal((len(time_s), 3))) * UNITS_PER_G + [20.0, -10.0, 5.0]
    raw[:, 1] += swing * UNITS_PER_G
    return RawReadings(time_s, raw, 22.0)


def vertical(pitch_deg: float, roll_deg: float) -> Array:
    x, y = np.sin(np.radians([pitch_deg, roll_deg]))
    return np.array([x, y, np.sqrt(1 - x * x - y * y)])


@pytest.mark.parametrize("housing_from_sensor", [STRAIGHT, X_UP])
def test_the_mean_points_along_the_rope_after_zeroing(housing_from_sensor: Array) -> None:
    force = housing_from_sensor.T @ vertical(2.0, -3.0)
    fit = zero_in_place(hanging_readings(force), make_parent(), housing_from_sensor, UNITS_PER_G)
    housing = housing_from_sensor @ fit.correction_matrix @ (force * UNITS_PER_G)
    np.testing.assert_allclose(housing, [0, 0, 1], atol=3e-4)
    assert fit.method == "zero"
    assert fit.offset == (20.0, -10.0, 5.0)
    assert fit.warnings[0] == FitWarning(SUM_WARNING)
    assert "removed pitch +2.0" in fit.warnings[1].text
    assert "roll -3.0" in fit.warnings[1].text


def test_the_turn_about_the_rope_is_not_changed() -> None:
    rotation = zeroing_rotation(vertical(4.0, -6.0))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation @ vertical(4.0, -6.0), [0, 0, 1], atol=1e-12)
    assert rotation[0, 1] == rotation[1, 0]  # no component about z


def test_the_uncertainty_is_that_of_the_rope_while_hanging_and_that_of_the_parent_in_other_attitudes() -> None:
    fit = zero_in_place(hanging_readings(vertical(1.0, 1.0)), make_parent(), STRAIGHT, UNITS_PER_G)
    raw = np.linalg.solve(fit.correction_matrix, [0, 0, 1.0])
    jacobian = np.hstack([np.kron(np.eye(3), raw), -fit.correction_matrix])
    u_hanging = np.sqrt(np.diag(jacobian @ fit.covariance @ jacobian.T))
    np.testing.assert_allclose(u_hanging[:2], np.radians(0.05), rtol=0.1)
    sideways = np.linalg.solve(fit.correction_matrix, [1.0, 0, 0])
    jacobian = np.hstack([np.kron(np.eye(3), sideways), -fit.correction_matrix])
    assert np.sqrt(np.diag(jacobian @ fit.covariance @ jacobian.T))[2] > 0.005


def test_a_short_rest_is_refused() -> None:
    with pytest.raises(NotDeterminedError, match="let the load hang still for 30 s"):
        zero_in_place(hanging_readings(vertical(1, 1), seconds=20.0), make_parent(), STRAIGHT, UNITS_PER_G)


def test_a_swinging_load_is_refused() -> None:
    with pytest.raises(NotDeterminedError, match="still swings"):
        zero_in_place(hanging_readings(vertical(1, 1), swing_g=0.01), make_parent(), STRAIGHT, UNITS_PER_G)


def test_an_implausible_mount_angle_is_refused() -> None:
    with pytest.raises(CalibrationError, match=r"12\.0 deg off the vertical, more than 10"):
        zero_in_place(hanging_readings(vertical(12, 0)), make_parent(), STRAIGHT, UNITS_PER_G)


def test_a_parent_record_that_contradicts_the_reading_is_refused() -> None:
    with pytest.raises(CalibrationError, match=r"\|m\| at rest is 1\.1"):
        zero_in_place(hanging_readings(1.1 * vertical(1, 1)), make_parent(), STRAIGHT, UNITS_PER_G)
