"""The record of a fit: fields, hash and id, and records of other origins."""

import json
from typing import Any

import numpy as np
import pytest

from devices.simulated.accelerometer import Accelerometer, factory_calibration, no_errors
from gateway.calibration.acceptance import make_record
from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.poses.pose import FACE_DIRECTIONS, Pose
from gateway.calibration.record import CalibrationRecord

FIELDS = {
    *("format", "id", "device_id", "method", "created_utc", "software", "by", "parent", "unit", "offset"),
    *("correction_matrix", "covariance", "prediction_interval_g", "temperature_c", "thermal", "poses"),
    *("misalignment_deg", "residual_rms_g", "condition_number", "budget", "warnings", "sha256"),
}
WHO: dict[str, Any] = {"device_id": "part-7", "unit": "counts", "software": "0.1.0", "by": "bench", "parent": None}


def make_fit(scale: float = 1000.0) -> CalibrationFit:
    """Return the fit of six faces, at temperatures from 20 to 25 °C."""
    poses = []
    for place, (face, up) in enumerate(FACE_DIRECTIONS.items()):
        x, y, z = (up * scale + 5).tolist()
        poses.append(
            Pose((x, y, z), (0.1, 0.1, 0.1), 300, face, temperature_c=20.0 + place, noise=(2.0, 2.0, 2.0), step=1.0)
        )
    return fit_six_positions(tuple(poses))


def test_a_record_has_every_published_field() -> None:
    content = make_record(make_fit(), created_utc="2026-11-21T10:15:00Z", **WHO).model_dump(mode="json")
    assert set(content) == FIELDS
    assert {"mean", "type_a", "count", "face", "used"} <= set(content["poses"][0])
    assert all(set(row) == {"source", "type", "u_g", "u_deg"} for row in content["budget"])
    assert np.array(content["covariance"]).shape == (12, 12)
    assert content["temperature_c"] == {"mean": 22.5, "min": 20.0, "max": 25.0}


def test_a_record_survives_a_file_unchanged() -> None:
    record = make_record(make_fit(), created_utc="2026-11-21T10:15:00Z", **WHO)
    again = CalibrationRecord.model_validate(json.loads(json.dumps(record.model_dump(mode="json"))))
    assert again == record
    assert again.sha256 == record.sha256


def test_ids_sort_by_time_and_distinguish_contents() -> None:
    first = make_record(make_fit(), created_utc="2026-11-21T10:15:00Z", **WHO)
    other = make_record(make_fit(1001.0), created_utc="2026-11-21T10:15:00Z", **WHO)
    later = make_record(make_fit(), created_utc="2026-11-21T10:15:01.25+00:00", **WHO)
    assert first.id.startswith("20261121T101500Z-")
    assert later.id.startswith("20261121T101501Z-")
    assert first.id != other.id
    assert sorted([later.id, first.id]) == [first.id, later.id]


def test_additional_fields_are_stored_and_hashed() -> None:
    record = make_record(make_fit(), created_utc="2026-11-21T10:15:00Z", request="r-1", **WHO)
    content = record.model_dump(mode="json")
    assert content["request"] == "r-1"
    with pytest.raises(ValueError, match="sha256 does not match"):
        CalibrationRecord.model_validate(content | {"request": "r-2"})


def test_a_changed_budget_is_detected() -> None:
    content = make_record(make_fit(), created_utc="2026-11-21T10:15:00Z", **WHO).model_dump(mode="json")
    content["budget"][0]["u_g"] = 0.0
    with pytest.raises(ValueError, match="sha256 does not match"):
        CalibrationRecord.model_validate(content)


def test_a_record_without_the_newer_fields_stays_as_it_is() -> None:
    content = factory_calibration("sim", Accelerometer(no_errors(), 100.0), np.random.default_rng(1))
    record = CalibrationRecord.model_validate(content)
    assert record.misalignment_deg is None
    assert record.model_dump(mode="json") == content
    assert CalibrationRecord.model_validate(record.model_dump(mode="json")) == record


def test_the_budget_contains_the_range_of_temperature() -> None:
    (row,) = [row for row in make_fit().budget if row["source"] == "temperature spread"]
    assert row["u_g"] == pytest.approx(0.5e-3 * 5 / np.sqrt(12))
