"""From raw to specific force: records, factory records, datasheet."""

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.calibration.correction import correction_for
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import parse

AXES = ((0, 1), (1, 1), (2, 1))
INFO = DeviceInfo(
    kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0, zero_g_offset_g=0.075
)


def test_record_is_applied_as_the_interface_states(record):
    stored = CalibrationRecord.model_validate(record())
    correction = correction_for(INFO, AXES, stored)
    raw = np.array([[100, 200, 1000], [-5, 0, 7]], dtype=np.int32)
    expected = [np.array(stored.correction_matrix) @ (row - np.array(stored.offset)) for row in raw]
    np.testing.assert_allclose(correction.apply(raw), expected, atol=1e-12)
    assert (correction.status, correction.calibration_id) == ("calibrated", "r1")
    np.testing.assert_allclose(correction.u_zero_g_offset_g, [1e-3, 2e-3, 3.03e-3], rtol=1e-3)
    np.testing.assert_allclose(correction.u_scale_factor, [1e-3, 0, 0], atol=1e-12)


def test_axes_map_turns_values_and_uncertainties(record):
    turned = correction_for(INFO, ((1, -1), (0, 1), (2, 1)), CalibrationRecord.model_validate(record()))
    straight = correction_for(INFO, AXES, CalibrationRecord.model_validate(record()))
    raw = np.array([[100, 200, 1000]], dtype=np.int32)
    x, y, z = straight.apply(raw)[0]
    np.testing.assert_allclose(turned.apply(raw)[0], [-y, x, z])
    np.testing.assert_allclose(turned.u_zero_g_offset_g, straight.u_zero_g_offset_g[[1, 0, 2]])


def test_without_a_record_the_datasheet_limit_is_the_uncertainty():
    correction = correction_for(INFO, AXES, None)
    assert correction.status == "uncalibrated"
    assert correction.calibration_id is None
    np.testing.assert_allclose(correction.apply(np.array([[0, 0, 1000]], dtype=np.int32)), [[0, 0, 1]])
    np.testing.assert_allclose(correction.u_zero_g_offset_g, 0.075 / np.sqrt(3))


def test_another_unit_is_refused(record):
    with pytest.raises(CalibrationError, match="for raw input in V"):
        correction_for(INFO, AXES, CalibrationRecord.model_validate(record(unit="V")))


def test_a_changed_record_is_refused(record):
    changed = record() | {"offset": [0.0, 0.0, 0.0]}
    with pytest.raises(CalibrationError, match="sha256 does not match"):
        parse(changed, "part-7", "x.json")


def test_how_the_axes_lie_counts_across_the_rope(record):
    """A frame known to 0.5 degrees is 8.7 mg across the rope at rest, and nothing along it."""
    covariance = np.zeros((12, 12))
    covariance[[2, 5], [2, 5]] = (np.radians(0.5) * 1e-3) ** 2  # of the entries that take z into x and y
    stored = CalibrationRecord.model_validate(record(covariance=covariance.tolist(), offset=[0.0, 0.0, 0.0]))
    u = correction_for(INFO, AXES, stored).u_zero_g_offset_g
    np.testing.assert_allclose(u, [np.radians(0.5) / 1.01, np.radians(0.5) / 1.01, 0], rtol=1e-2, atol=1e-9)
