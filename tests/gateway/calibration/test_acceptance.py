"""Acceptance of a fit: its limits, and the findings that require a reason."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.calibration.acceptance import change_since, judge, make_record
from gateway.calibration.calibration_fit import CalibrationFit, FitWarning, WarningKind
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.poses.pose import FACE_DIRECTIONS, Pose
from gateway.calibration.record import CalibrationRecord


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
    warnings = (FitWarning(WarningKind.OUTLIER, "U_x"), FitWarning(WarningKind.SCATTER, "something else"))
    acceptance = judge(replace(make_fit(), warnings=warnings), None)
    assert acceptance.implausible == ("outlier: U_x",)
    assert acceptance.notes == ("something else",)
