"""Acceptance of a fit: its limits, findings that require a reason, and its record: fields, hash and id, other origins.

The prediction interval, which is one of the limits, is tested against its closed form (Łuczak n.d., eq. 14).
"""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from devices.simulated.accelerometer import Accelerometer, factory_calibration, no_errors
from gateway.calibration.acceptance import change_since, judge, make_record
from gateway.calibration.calibration_fit import CalibrationFit, FitWarning, prediction_interval_g
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.pose import FACE_DIRECTIONS, Pose
from gateway.calibration.record import CalibrationRecord

FIELDS = {
    *("format", "id", "device_id", "method", "created_utc", "software", "by", "parent", "unit", "offset"),
    *("correction_matrix", "covariance", "prediction_interval_g", "temperature_c", "thermal", "poses"),
    *("misalignment_deg", "residual_rms_g", "condition_number", "budget", "warnings", "sha256"),
}
VOLTS_PER_G = 0.42
WHO: dict[str, Any] = {"device_id": "part-7", "unit": "counts", "software": "0.1.0", "by": "bench", "parent": None}


def make_fit(gain: float = 1.0, offset_g: tuple[float, float, float] = (0.01, 0.02, 0.03)) -> CalibrationFit:
    """Return the fit of six faces without errors of placement or noise."""
    poses = []
    for face, up in FACE_DIRECTIONS.items():
        x, y, z = (gain * up + offset_g).tolist()
        poses.append(Pose((x, y, z), (1e-5, 1e-5, 1e-5), 300, face, noise=(2e-4, 2e-4, 2e-4)))
    return fit_six_positions(tuple(poses))


def make_parent() -> CalibrationRecord:
    """Return the record of the fit."""
    return make_record(
        make_fit(), device_id="d", unit="g", software="1", by="x", created_utc="2026-01-01T00:00:00Z", parent=None
    )


def test_a_good_fit_is_accepted_with_or_without_a_parent() -> None:
    for parent in (None, make_parent()):
        acceptance = judge(make_fit(), parent)
        assert (acceptance.refused, acceptance.implausible) == ((), ())
        assert acceptance.refusal(reason="") is None


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("residual_rms_g", 0.02, "residual 0.02 g is above the limit of 0.01"),
        ("condition_number", 50.0, "condition number 50 is above the limit of 30"),
        ("prediction_interval_g", 0.5, "prediction interval 0.5 g is above"),
        ("covariance", -np.eye(12), "negative variances"),
    ],
)
def test_a_fit_beyond_a_limit_is_refused_whatever_the_reason(field: str, value: Any, text: str) -> None:
    acceptance = judge(replace(make_fit(), **{field: value}), None)
    assert len(acceptance.refused) == 1
    assert text in acceptance.refused[0]
    assert acceptance.refusal(reason="new sensor") == acceptance.refused[0]


def test_an_implausible_drift_requires_a_reason() -> None:
    acceptance = judge(make_fit(offset_g=(0.01, 0.02, 0.06)), make_parent())
    assert acceptance.refused == ()
    assert acceptance.implausible == (f"offset z has moved by +30.0 mg since {make_parent().id}",)
    assert acceptance.refusal(reason=" ") == f"{acceptance.implausible[0]}; give a reason"
    assert acceptance.refusal(reason="new sensor") is None
    scaled = judge(make_fit(gain=1.02), make_parent())
    assert any("scale x has changed by +2.00 %" in text for text in scaled.implausible)


def test_a_rotated_sensor_requires_a_reason() -> None:
    angle = np.radians(3.0)
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    rotated = replace(make_fit(), correction_matrix=rotation @ make_fit().correction_matrix)
    np.testing.assert_allclose(change_since(rotated, make_parent()).rotation_deg, [0, 0, -3.0], atol=0.01)
    assert any("turned by 3.0 deg" in text for text in judge(rotated, make_parent()).implausible)


def test_an_outlier_requires_a_reason_and_other_warnings_are_notes() -> None:
    warnings = (FitWarning("U_x", is_outlier=True), FitWarning("something else"))
    acceptance = judge(replace(make_fit(), warnings=warnings), None)
    assert acceptance.implausible == ("outlier: U_x",)
    assert acceptance.notes == ("something else",)


def six_faces(scale: float = 1000.0) -> CalibrationFit:
    """Return the fit of six faces in counts, at temperatures from 20 to 25 °C."""
    poses = []
    for place, (face, up) in enumerate(FACE_DIRECTIONS.items()):
        x, y, z = (up * scale + 5).tolist()
        poses.append(
            Pose((x, y, z), (0.1, 0.1, 0.1), 300, face, temperature_c=20.0 + place, noise=(2.0, 2.0, 2.0), step=1.0)
        )
    return fit_six_positions(tuple(poses))


def test_a_record_has_every_published_field() -> None:
    content = make_record(six_faces(), created_utc="2026-11-21T10:15:00Z", **WHO).model_dump(mode="json")
    assert set(content) == FIELDS
    assert {"mean", "type_a", "count", "face", "used"} <= set(content["poses"][0])
    assert all(set(row) == {"source", "type", "u_g", "u_deg"} for row in content["budget"])
    assert np.array(content["covariance"]).shape == (12, 12)
    assert content["temperature_c"] == {"mean": 22.5, "min": 20.0, "max": 25.0}


def test_a_record_survives_a_file_unchanged() -> None:
    record = make_record(six_faces(), created_utc="2026-11-21T10:15:00Z", **WHO)
    again = CalibrationRecord.model_validate(json.loads(json.dumps(record.model_dump(mode="json"))))
    assert again == record
    assert again.sha256 == record.sha256


def test_ids_sort_by_time_and_distinguish_contents() -> None:
    first = make_record(six_faces(), created_utc="2026-11-21T10:15:00Z", **WHO)
    other = make_record(six_faces(1001.0), created_utc="2026-11-21T10:15:00Z", **WHO)
    later = make_record(six_faces(), created_utc="2026-11-21T10:15:01.25+00:00", **WHO)
    assert first.id.startswith("20261121T101500Z-")
    assert later.id.startswith("20261121T101501Z-")
    assert first.id != other.id
    assert sorted([later.id, first.id]) == [first.id, later.id]


def test_additional_fields_are_stored_and_hashed() -> None:
    record = make_record(six_faces(), created_utc="2026-11-21T10:15:00Z", request="r-1", **WHO)
    content = record.model_dump(mode="json")
    assert content["request"] == "r-1"
    with pytest.raises(ValueError, match="sha256 does not match"):
        CalibrationRecord.model_validate(content | {"request": "r-2"})


def test_a_changed_budget_is_detected() -> None:
    content = make_record(six_faces(), created_utc="2026-11-21T10:15:00Z", **WHO).model_dump(mode="json")
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
    (row,) = [row for row in six_faces().budget if row["source"] == "temperature spread"]
    assert row["u_g"] == pytest.approx(0.5e-3 * 5 / np.sqrt(12))


def interval_g(u_scale: float, u_offset_g: float, noise_g: float) -> float:
    covariance = np.zeros((12, 12))
    covariance[0, 0] = (u_scale / VOLTS_PER_G) ** 2  # of the first entry of the matrix alone
    covariance[9:, 9:] = (u_offset_g * VOLTS_PER_G) ** 2 * np.eye(3)
    return prediction_interval_g(np.eye(3) / VOLTS_PER_G, covariance, noise_g)


def test_the_prediction_interval_is_three_standard_deviations_of_noise_offset_and_scale_together() -> None:
    assert interval_g(0.0, 0.0, 0.002) == pytest.approx(0.006)
    assert interval_g(0.0, 0.003, 0.0) == pytest.approx(0.009)
    assert interval_g(0.004, 0.0, 0.0) == pytest.approx(0.012)
    assert interval_g(0.004, 0.003, 0.012) == pytest.approx(3 * 0.013)
