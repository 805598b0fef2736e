"""The correction: from raw readings to specific force by a record, a factory record, or the data sheet."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.calibration.correction import correction_for
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import parse_record
from tests.gateway.conftest import record_content

AXES = ((0, 1), (1, 1), (2, 1))
INFO = DeviceInfo(
    kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0, zero_g_offset_g=0.075
)

MakeContent = Callable[..., dict[str, Any]]


def test_a_record_is_applied_as_the_interface_states() -> None:
    stored = CalibrationRecord.model_validate(record_content())
    correction = correction_for(INFO, AXES, stored)
    raw = np.array([[100, 200, 1000], [-5, 0, 7]], dtype=np.int32)
    expected = [np.array(stored.correction_matrix) @ (row - np.array(stored.offset)) for row in raw]
    np.testing.assert_allclose(correction.apply(raw), expected, atol=1e-12)
    assert (correction.status, correction.calibration_id) == ("calibrated", "r1")
    np.testing.assert_allclose(correction.u_zero_g_offset_g, [1e-3, 2e-3, 3.03e-3], rtol=1e-3)
    np.testing.assert_allclose(correction.u_scale_factor, [1e-3, 0, 0], atol=1e-12)


def test_the_axes_map_rotates_values_and_uncertainties() -> None:
    rotated = correction_for(INFO, ((1, -1), (0, 1), (2, 1)), CalibrationRecord.model_validate(record_content()))
    straight = correction_for(INFO, AXES, CalibrationRecord.model_validate(record_content()))
    raw = np.array([[100, 200, 1000]], dtype=np.int32)
    x, y, z = straight.apply(raw)[0]
    np.testing.assert_allclose(rotated.apply(raw)[0], [-y, x, z])
    np.testing.assert_allclose(rotated.u_zero_g_offset_g, straight.u_zero_g_offset_g[[1, 0, 2]])


def test_without_a_record_the_limit_of_the_data_sheet_is_the_uncertainty() -> None:
    correction = correction_for(INFO, AXES, None)
    assert correction.status == "uncalibrated"
    assert correction.calibration_id is None
    np.testing.assert_allclose(correction.apply(np.array([[0, 0, 1000]], dtype=np.int32)), [[0, 0, 1]])
    np.testing.assert_allclose(correction.u_zero_g_offset_g, 0.075 / np.sqrt(3))


def test_a_record_in_another_unit_is_refused() -> None:
    with pytest.raises(CalibrationError, match="for raw input in V"):
        correction_for(INFO, AXES, CalibrationRecord.model_validate(record_content(unit="V")))


def test_a_changed_record_is_refused() -> None:
    changed = record_content() | {"offset": [0.0, 0.0, 0.0]}
    with pytest.raises(CalibrationError, match="sha256 does not match"):
        parse_record(changed, "part-7", "x.json")


def test_the_attitude_of_the_axes_counts_across_the_rope_only() -> None:
    """A frame with an uncertainty of 0.5 degrees is 8.7 mg across the rope at rest, and nothing along it."""
    covariance = np.zeros((12, 12))
    covariance[[2, 5], [2, 5]] = (np.radians(0.5) * 1e-3) ** 2  # of the entries that take z into x and y
    stored = CalibrationRecord.model_validate(record_content(covariance=covariance.tolist(), offset=[0.0, 0.0, 0.0]))
    u_g = correction_for(INFO, AXES, stored).u_zero_g_offset_g
    np.testing.assert_allclose(u_g, [np.radians(0.5) / 1.01, np.radians(0.5) / 1.01, 0], rtol=1e-2, atol=1e-9)


def test_the_uncertainty_grows_beyond_the_temperatures_of_the_calibration() -> None:
    """Type B from the limits of the data sheet per kelvin, from the nearer end of the calibration's range."""
    info = dataclasses.replace(INFO, zero_g_offset_g_per_k=0.15e-3, scale_factor_per_k=1e-4)
    content = record_content(temperature_c={"mean": 22.0, "min": 20.0, "max": 24.0})
    correction = correction_for(info, AXES, CalibrationRecord.model_validate(content))
    inside = correction.widened_by(correction.kelvin_beyond(21.5))
    at_34 = correction.widened_by(correction.kelvin_beyond(34.0))

    np.testing.assert_array_equal(inside.u_zero_g_offset_g, correction.u_zero_g_offset_g)
    added_g = np.sqrt(at_34.u_zero_g_offset_g**2 - correction.u_zero_g_offset_g**2)
    np.testing.assert_allclose(added_g, 10 * 0.15e-3 / np.sqrt(3))
    added = np.sqrt(at_34.u_scale_factor**2 - correction.u_scale_factor**2)
    np.testing.assert_allclose(added, 10 * 1e-4 / np.sqrt(3))
    assert correction.kelvin_beyond(14.2) == 6
    assert correction.range_warnings(22.0) == correction.range_warnings(None) == ()
    assert correction.range_warnings(34.0) == ("widened: at 34 °C, calibrated at 20 to 24 °C",)
    assert (correction.u_force_g(np.zeros(3), 34.0) > correction.u_force_g(np.zeros(3), 22.0)).all()


def test_without_a_temperature_in_the_record_no_temperature_is_beyond_it() -> None:
    correction = correction_for(INFO, AXES, CalibrationRecord.model_validate(record_content(temperature_c=None)))
    assert correction.kelvin_beyond(60.0) == 0
