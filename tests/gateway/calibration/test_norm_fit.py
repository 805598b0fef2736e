"""Norm fit: injected errors, the reference frame, and poses that leave parameters undetermined."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.calibration.acceptance import make_record
from gateway.calibration.methods.experiment_design import condition_number, next_direction, worst_combination
from gateway.calibration.methods.norm_fit import fit_norm
from gateway.calibration.pose import Pose, candidate_directions
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.numerics.array import Array

GAIN = np.array([[1.03, 0.02, -0.02], [0.01, 0.97, 0.02], [-0.02, 0.02, 1.03]])
OFFSET = np.array([0.05, -0.05, 0.05])
UNITS_PER_G = 256.0
DIRECTIONS = candidate_directions()
FACES_AND_EDGES = DIRECTIONS[:18]


def poses_of(up: Array, u: float = 1e-6, random: np.random.Generator | None = None) -> tuple[Pose, ...]:
    """Return poses in these directions, with the injected errors and with noise from `random`, g."""
    means = (up @ GAIN.T + OFFSET) * UNITS_PER_G
    if random is not None:
        means = means + u * UNITS_PER_G * random.standard_normal(means.shape)
    u_raw = u * UNITS_PER_G
    return tuple(Pose((x, y, z), (u_raw, u_raw, u_raw), 300, None) for x, y, z in means.tolist())


def test_injected_errors_are_recovered_in_the_symmetric_frame() -> None:
    fit = fit_norm(poses_of(DIRECTIONS), UNITS_PER_G)
    matrix = fit.correction_matrix * UNITS_PER_G
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    rotation = matrix @ GAIN  # a correction recovers the readings up to a rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(fit.offset, OFFSET * UNITS_PER_G, atol=1e-7)
    assert fit.residual_rms_g < 1e-9


@pytest.mark.parametrize("units_per_g", [UNITS_PER_G * 0.75, UNITS_PER_G * 1.3])
def test_the_nominal_sensitivity_does_not_matter(units_per_g: float) -> None:
    given, other = fit_norm(poses_of(DIRECTIONS), UNITS_PER_G), fit_norm(poses_of(DIRECTIONS), units_per_g)
    np.testing.assert_allclose(other.correction_matrix, given.correction_matrix, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_the_covariance_is_that_of_many_sessions() -> None:
    random = np.random.default_rng(7)
    fits = [fit_norm(poses_of(FACES_AND_EDGES, 1e-4, random), UNITS_PER_G, frame_u_deg=0.0) for _ in range(500)]
    found = np.array([[*fit.correction_matrix.ravel(), *fit.offset] for fit in fits]).std(axis=0)
    np.testing.assert_allclose(found, np.sqrt(np.diag(fits[0].covariance)), rtol=0.15)


def test_the_unknown_attitude_of_the_frame_is_in_the_covariance() -> None:
    fit = fit_norm(poses_of(DIRECTIONS), UNITS_PER_G, frame_u_deg=0.5)
    (frame,) = [row for row in fit.budget if row["source"].startswith("attitude of the frame")]
    assert (frame["type"], frame["u_deg"]) == ("B", pytest.approx(0.5, rel=0.01))
    assert fit.prediction_interval_g < 1e-3  # a rotation changes no norm


def make_parent(matrix: Array, offset: Array, u_rad: float) -> CalibrationRecord:
    """Return a record with this standard uncertainty of each entry of its matrix, relative."""
    covariance = np.zeros((12, 12))
    covariance[:9, :9] = (u_rad / UNITS_PER_G) ** 2 * np.eye(9)
    fit = replace(
        fit_norm(poses_of(DIRECTIONS), UNITS_PER_G),
        correction_matrix=matrix,
        offset=(float(offset[0]), float(offset[1]), float(offset[2])),
        covariance=covariance,
    )
    return make_record(
        fit, device_id="d", unit="counts", software="1", by="x", created_utc="2026-01-01T00:00:00Z", parent=None
    )


def test_the_reference_frame_of_an_earlier_record_is_kept() -> None:
    """The sensor is rotated by 4 degrees in its housing; the earlier record knows it, and offset and scale have aged."""
    angle = np.radians(4.0)
    turned = GAIN @ np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    aged = np.linalg.inv(turned) @ np.diag([1.01, 0.99, 1.0]) / UNITS_PER_G
    parent = make_parent(aged, (OFFSET + 0.01) * UNITS_PER_G, np.radians(0.1))
    means = (DIRECTIONS @ turned.T + OFFSET) * UNITS_PER_G
    poses = tuple(Pose((x, y, z), (1e-4, 1e-4, 1e-4), 300, None) for x, y, z in means.tolist())
    fit = fit_norm(poses, UNITS_PER_G, parent=parent)
    np.testing.assert_allclose(fit.correction_matrix @ turned * UNITS_PER_G, np.eye(3), atol=1e-3)
    (frame,) = [row for row in fit.budget if row["source"] == f"attitude of the frame, as of record {parent.id}"]
    assert frame["u_deg"] == pytest.approx(0.1 / np.sqrt(2), rel=0.1)


def test_too_few_poses_are_refused() -> None:
    with pytest.raises(NotDeterminedError, match="8 poses for 9 unknowns; take 1 more"):
        fit_norm(poses_of(DIRECTIONS[:8]), UNITS_PER_G)


def test_an_undetermined_parameter_is_named_with_the_pose_that_helps() -> None:
    """Without a pose between x and y their cross-axis sensitivity is undetermined, for any number of poses."""
    up = np.array([pose for pose in DIRECTIONS if pose[0] * pose[1] == 0])
    with pytest.raises(
        NotDeterminedError, match=r"do not determine cross-axis xy .*add a pose with up between .x and .y"
    ):
        fit_norm(poses_of(up), UNITS_PER_G)


def test_poses_in_one_half_space_are_worse_than_in_all_directions() -> None:
    upper = DIRECTIONS[DIRECTIONS[:, 2] > -0.1]
    assert condition_number(upper) > 3 * condition_number(DIRECTIONS)
    assert "scale z" in worst_combination(upper) or "offset z" in worst_combination(upper)


def test_nine_requested_poses_determine_all_parameters() -> None:
    up = np.empty((0, 3))
    for _ in range(9):
        up = np.vstack([up, next_direction(up)])
    assert condition_number(up) < 4
    for _ in range(17):
        direction = next_direction(up)
        better = np.linalg.det(_information(np.vstack([up, direction])))
        assert all(better >= np.linalg.det(_information(np.vstack([up, other]))) * (1 - 1e-2) for other in DIRECTIONS)
        up = np.vstack([up, direction])


def _information(up: Array) -> Array:
    x, y, z = up.T
    rows = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, -x, -y, -z])
    return np.asarray(rows.T @ rows)


def test_magnitudes_that_scatter_more_than_the_noise_enlarge_the_uncertainty() -> None:
    random = np.random.default_rng(8)
    quiet = fit_norm(poses_of(DIRECTIONS, 1e-4, random), UNITS_PER_G)
    assert quiet.warnings == ()
    moved = []
    for pose in poses_of(DIRECTIONS, 1e-4):
        x, y, z = (np.array(pose.mean) * (1 + random.normal(0, 2e-3))).tolist()
        moved.append(Pose((x, y, z), pose.type_a, 300, None))
    fit = fit_norm(tuple(moved), UNITS_PER_G)
    (warning,) = fit.warnings
    assert warning.text.startswith("the norms scatter")
    assert fit.covariance[9, 9] > 50 * quiet.covariance[9, 9]


def test_a_pose_that_moved_is_left_out_and_named() -> None:
    random = np.random.default_rng(8)
    poses = list(poses_of(DIRECTIONS, 1e-4, random))
    x, y, z = (np.array(poses[4].mean) * 1.01).tolist()
    poses[4] = replace(poses[4], mean=(x, y, z))
    fit = fit_norm(tuple(poses), UNITS_PER_G)
    (warning,) = fit.warnings
    assert warning.is_outlier
    assert "pose 5 reads" in warning.text
    assert [pose.used for pose in fit.poses].count(False) == 1
    assert fit.residual_rms_g < 3e-4


def test_a_fit_of_nine_poses_is_reported_as_unchecked() -> None:
    up = np.empty((0, 3))
    for _ in range(9):
        up = np.vstack([up, next_direction(up)])
    (warning,) = fit_norm(poses_of(up), UNITS_PER_G).warnings
    assert "nothing checks the fit" in warning.text
