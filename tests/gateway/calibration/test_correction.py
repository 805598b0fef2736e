"""From raw to specific force: records, factory records, datasheet."""

import json

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.calibration.correction import correction_for
from gateway.calibration.record import CalibrationError, CalibrationRecord, content_hash
from gateway.calibration.store import find, parse, record_path

AXES = ((0, 1), (1, 1), (2, 1))
INFO = DeviceInfo(
    kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0, zero_g_offset_g=0.075
)


def record(**changes):
    covariance = np.zeros((12, 12))
    covariance[[9, 10, 11], [9, 10, 11]] = [1.0, 4.0, 9.0]  # counts squared
    covariance[0, 0] = (1e-6) ** 2
    content = {
        "format": 1,
        "id": "r1",
        "device_id": "part-7",
        "method": "six-position",
        "created_utc": "2026-01-01T00:00:00Z",
        "software": "0.1.0",
        "by": "bench",
        "parent": None,
        "unit": "counts",
        "offset": [10.0, -20.0, 30.0],
        "correction_matrix": [[1e-3, 1e-5, 0], [0, 1e-3, 0], [0, 0, 1.01e-3]],
        "covariance": covariance.tolist(),
        "prediction_interval_g": 0.003,
        "temperature_c": None,
        "warnings": ["kept though not modelled"],
    } | changes
    return content | {"sha256": content_hash(content)}


def test_record_is_applied_as_the_interface_states():
    stored = CalibrationRecord.model_validate(record())
    correction = correction_for(INFO, AXES, stored)
    raw = np.array([[100, 200, 1000], [-5, 0, 7]], dtype=np.int32)
    expected = [np.array(stored.correction_matrix) @ (row - np.array(stored.offset)) for row in raw]
    np.testing.assert_allclose(correction.apply(raw), expected, atol=1e-12)
    assert (correction.status, correction.calibration_id) == ("calibrated", "r1")
    np.testing.assert_allclose(correction.u_zero_g_offset_g, [1e-3, 2e-3, 3.03e-3], rtol=1e-3)
    np.testing.assert_allclose(correction.u_scale_factor, [1e-3, 0, 0], atol=1e-12)


def test_axes_map_turns_values_and_uncertainties():
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


def test_another_unit_is_refused():
    with pytest.raises(CalibrationError, match="for raw input in V"):
        correction_for(INFO, AXES, CalibrationRecord.model_validate(record(unit="V")))


def test_a_changed_record_is_refused(tmp_path):
    changed = record() | {"offset": [0.0, 0.0, 0.0]}
    with pytest.raises(CalibrationError, match="sha256 does not match"):
        parse(changed, "part-7", "x.json")


def test_a_swapped_sensor_inherits_nothing(tmp_path):
    path = record_path(tmp_path, "part-8")
    path.parent.mkdir()
    path.write_text(json.dumps(record()))
    with pytest.raises(CalibrationError, match="belongs to part-7, not to part-8"):
        find(tmp_path, "part-8")
    assert find(tmp_path, "part-7") is None


def test_a_torn_record_is_named(tmp_path):
    path = record_path(tmp_path, "part-7")
    path.parent.mkdir()
    path.write_text(json.dumps(record())[:100])
    with pytest.raises(CalibrationError, match=r"part-7\.json: cannot be read"):
        find(tmp_path, "part-7")


def test_stored_record_is_found_by_identity(tmp_path):
    path = record_path(tmp_path, "part-7")
    path.parent.mkdir()
    path.write_text(json.dumps(record()))
    found = find(tmp_path, "part-7")
    assert found is not None
    assert found.id == "r1"
