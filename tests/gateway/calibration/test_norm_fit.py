"""Norm fit: planted errors, the frame, and what the poses do not determine."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.calibration.methods.experiment_design import conditioning, next_direction, worst_combination
from gateway.calibration.methods.norm_fit import fit_norm
from gateway.calibration.poses.faces import candidate_directions
from gateway.calibration.poses.pose import Pose
from gateway.calibration.record import NotDeterminedError
from gateway.calibration.record_factory import make_record

GAIN = np.array([[1.03, 0.02, -0.02], [0.01, 0.97, 0.02], [-0.02, 0.02, 1.03]])
OFFSET = np.array([0.05, -0.05, 0.05])
UNITS_PER_G = 256.0
ALL_ROUND = candidate_directions()
FACES_AND_EDGES = ALL_ROUND[:18]


def poses_of(up, u=1e-6, random=None):
    means = (up @ GAIN.T + OFFSET) * UNITS_PER_G
    if random is not None:
        means = means + u * UNITS_PER_G * random.standard_normal(means.shape)
    return tuple(Pose(tuple(mean), (u * UNITS_PER_G,) * 3, 300, None) for mean in means.tolist())


def test_planted_errors_come_back_in_the_symmetric_frame():
    fit = fit_norm(poses_of(ALL_ROUND), UNITS_PER_G)
    matrix = fit.correction_matrix * UNITS_PER_G
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    rotation = matrix @ GAIN  # what is left of a correction is a rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(fit.offset, OFFSET * UNITS_PER_G, atol=1e-7)
    assert fit.residual_rms_g < 1e-9


@pytest.mark.parametrize("units_per_g", [UNITS_PER_G * 0.75, UNITS_PER_G * 1.3])
def test_the_nominal_sensitivity_does_not_matter(units_per_g):
    given, other = fit_norm(poses_of(ALL_ROUND), UNITS_PER_G), fit_norm(poses_of(ALL_ROUND), units_per_g)
    np.testing.assert_allclose(other.correction_matrix, given.correction_matrix, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_covariance_is_that_of_many_sessions():
    random = np.random.default_rng(7)
    fits = [fit_norm(poses_of(FACES_AND_EDGES, 1e-4, random), UNITS_PER_G, frame_u_deg=0.0) for _ in range(500)]
    found = np.array([[*fit.correction_matrix.ravel(), *fit.offset] for fit in fits]).std(axis=0)
    np.testing.assert_allclose(found, np.sqrt(np.diag(fits[0].covariance)), rtol=0.15)


def test_the_attitude_that_it_cannot_see_is_in_the_covariance():
    fit = fit_norm(poses_of(ALL_ROUND), UNITS_PER_G, frame_u_deg=0.5)
    (frame,) = [row for row in fit.budget if row["source"].startswith("attitude of the frame")]
    assert (frame["type"], frame["u_deg"]) == ("B", pytest.approx(0.5, rel=0.01))
    assert fit.prediction_interval_g < 1e-3  # a rotation changes no norm


def recorded(matrix, offset, u_rad):
    """A parent whose matrix is known to this in each entry."""
    covariance = np.zeros((12, 12))
    covariance[:9, :9] = (u_rad / UNITS_PER_G) ** 2 * np.eye(9)
    fit = replace(
        fit_norm(poses_of(ALL_ROUND), UNITS_PER_G),
        correction_matrix=matrix,
        offset=tuple(offset),
        covariance=covariance,
    )
    return make_record(
        fit, device_id="d", unit="counts", software="1", by="x", created_utc="2026-01-01T00:00:00Z", parent=None
    )


def test_the_frame_of_an_earlier_record_is_kept():
    """The part is turned by 4 degrees in its housing; the earlier record knows it, and its offset and scale have aged."""
    angle = np.radians(4.0)
    turned = GAIN @ np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    aged = np.linalg.inv(turned) @ np.diag([1.01, 0.99, 1.0]) / UNITS_PER_G
    parent = recorded(aged, (OFFSET + 0.01) * UNITS_PER_G, np.radians(0.1))
    means = (ALL_ROUND @ turned.T + OFFSET) * UNITS_PER_G
    poses = tuple(Pose(tuple(mean), (1e-4,) * 3, 300, None) for mean in means.tolist())
    fit = fit_norm(poses, UNITS_PER_G, parent=parent)
    np.testing.assert_allclose(fit.correction_matrix @ turned * UNITS_PER_G, np.eye(3), atol=1e-3)
    (frame,) = [row for row in fit.budget if row["source"] == f"attitude of the frame, as of record {parent.id}"]
    assert frame["u_deg"] == pytest.approx(0.1 / np.sqrt(2), rel=0.1)


def test_too_few_poses_are_refused():
    with pytest.raises(NotDeterminedError, match="8 poses for 9 unknowns; take 1 more"):
        fit_norm(poses_of(ALL_ROUND[:8]), UNITS_PER_G)


def test_what_the_poses_leave_open_is_named_with_the_pose_that_helps():
    """No pose between x and y: their cross-axis sensitivity is open, however many poses there are."""
    up = np.array([pose for pose in ALL_ROUND if pose[0] * pose[1] == 0])
    with pytest.raises(
        NotDeterminedError, match=r"do not determine cross-axis xy .*add a pose with up between .x and .y"
    ):
        fit_norm(poses_of(up), UNITS_PER_G)


def test_poses_of_one_half_space_are_worse_than_all_round():
    upper = ALL_ROUND[ALL_ROUND[:, 2] > -0.1]
    assert conditioning(upper) > 3 * conditioning(ALL_ROUND)
    assert "scale z" in worst_combination(upper) or "offset z" in worst_combination(upper)


def test_the_asked_for_poses_determine_it_from_nine_on():
    up = np.empty((0, 3))
    for _ in range(9):
        up = np.vstack([up, next_direction(up)])
    assert conditioning(up) < 4
    for _ in range(17):
        direction = next_direction(up)
        better = np.linalg.det(_information(np.vstack([up, direction])))
        assert all(better >= np.linalg.det(_information(np.vstack([up, other]))) * (1 - 1e-2) for other in ALL_ROUND)
        up = np.vstack([up, direction])


def _information(up):
    x, y, z = up.T
    rows = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, -x, -y, -z])
    return rows.T @ rows


def test_norms_that_scatter_more_than_the_noise_widen_the_uncertainty():
    random = np.random.default_rng(8)
    quiet = fit_norm(poses_of(ALL_ROUND, 1e-4, random), UNITS_PER_G)
    assert quiet.warnings == ()
    moved = [
        Pose(tuple(np.array(pose.mean) * (1 + random.normal(0, 2e-3))), pose.type_a, 300, None)
        for pose in poses_of(ALL_ROUND, 1e-4)
    ]
    fit = fit_norm(tuple(moved), UNITS_PER_G)
    assert any("times as much as the noise explains" in text for text in fit.warnings)
    assert fit.covariance[9, 9] > 50 * quiet.covariance[9, 9]


def test_nine_poses_are_told_to_be_unchecked():
    up = np.empty((0, 3))
    for _ in range(9):
        up = np.vstack([up, next_direction(up)])
    assert any("nothing checks the fit" in text for text in fit_norm(poses_of(up), UNITS_PER_G).warnings)
