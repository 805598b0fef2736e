"""The judge: limits, and what asks for a reason."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.calibration.acceptance import change, judge
from gateway.calibration.methods.calibration_fit import OUTLIER
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.poses.faces import FACE_DIRECTIONS
from gateway.calibration.poses.pose import Pose
from gateway.calibration.record_factory import make_record


def fit(gain=1.0, offset_g=(0.01, 0.02, 0.03)):
    poses = tuple(
        Pose(tuple((gain * up + offset_g).tolist()), (1e-5,) * 3, 300, face, noise=(2e-4,) * 3)
        for face, up in FACE_DIRECTIONS.items()
    )
    return fit_six_positions(poses)


def record(found=None):
    return make_record(
        found or fit(), device_id="d", unit="g", software="1", by="x", created_utc="2026-01-01T00:00:00Z", parent=None
    )


def test_a_good_fit_passes_with_or_without_a_parent():
    for parent in (None, record()):
        word = judge(fit(), parent)
        assert (word.refusals, word.needs_reason) == ((), ())


def test_a_record_is_judged_as_its_fit_is():
    assert judge(record(), record()) == judge(fit(), record())


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("residual_rms_g", 0.02, "residual 0.02 g is above the limit of 0.01"),
        ("condition_number", 50.0, "condition number 50 is above the limit of 30"),
        ("prediction_interval_g", 0.5, "prediction interval 0.5 g is above"),
        ("covariance", -np.eye(12), "negative variances"),
    ],
)
def test_limits_are_refusals(field, value, text):
    word = judge(replace(fit(), **{field: value}), None)
    assert len(word.refusals) == 1
    assert text in word.refusals[0]


def test_drift_beyond_plausibility_asks_for_a_reason():
    word = judge(fit(offset_g=(0.01, 0.02, 0.06)), record())
    assert word.refusals == ()
    assert word.needs_reason == (f"offset z has moved by +30.0 mg since {record().id}",)
    assert any("scale x has changed by +2.00 %" in text for text in judge(fit(gain=1.02), record()).needs_reason)


def test_a_turned_sensor_asks_for_a_reason():
    angle = np.radians(3.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    turned = replace(fit(), correction_matrix=turn @ fit().correction_matrix)
    assert change(turned, record()).turn_deg == pytest.approx(3.0, abs=0.01)
    assert any("turned by 3.0 deg" in text for text in judge(turned, record()).needs_reason)


def test_an_outlier_asks_for_a_reason():
    word = judge(replace(fit(), warnings=(f"{OUTLIER} U_x", "something else")), None)
    assert word.needs_reason == (f"{OUTLIER} U_x",)
    assert word.notes == ("something else",)
