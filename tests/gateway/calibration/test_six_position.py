"""Six positions: the published tables, injected errors, missing faces and outliers."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gateway.calibration.acceptance import find_changed_readings
from gateway.calibration.calibration_fit import FitWarning
from gateway.calibration.methods.non_linearity import find_non_linearity
from gateway.calibration.methods.six_position import (
    apply_extremes,
    find_extremes,
    fit_six_positions,
)
from gateway.calibration.pose import (
    FACE_DIRECTIONS,
    FACES,
    Face,
    Pose,
    candidate_directions,
    find_face,
    without_tilted_poses,
)
from gateway.calibration.record import NotDeterminedError
from gateway.numerics.array import Array

TABLES = json.loads((Path(__file__).parents[2] / "data" / "calibration" / "luczak_2022_tables.json").read_text())
TYPE_A_V = TABLES["type_A_uncertainty_V"]


def table(number: int) -> tuple[Pose, ...]:
    """Return the poses of one published table, with the faces found from the readings."""
    means = [(row["U_x_V"], row["U_y_V"], row["U_z_V"]) for row in TABLES["tables_1_to_5"][number - 1]["positions"]]
    return tuple(
        Pose(mean, (TYPE_A_V, TYPE_A_V, TYPE_A_V), 300, find_face((np.array(mean) - 1.5) / 0.42)) for mean in means
    )


def published(name: str, number: int) -> list[float]:
    row = TABLES[name][number - 1]
    return [float(row[axis]) for axis in "xyz"]


def place_on_faces(
    gain: Array, offset: Array, tilts_deg: Array | None = None, noise_u: float = 1e-6
) -> tuple[Pose, ...]:
    """Return one pose for each face of a sensor with this gain and offset in g; `tilts_deg` by face, a rotation vector."""
    poses = []
    for place, (face, up) in enumerate(FACE_DIRECTIONS.items()):
        turn = np.zeros(3) if tilts_deg is None else np.radians(tilts_deg[place])
        x, y, z = (gain @ (up + np.cross(turn, up)) + offset).tolist()
        poses.append(Pose((x, y, z), (noise_u, noise_u, noise_u), 300, face))
    return tuple(poses)


GAIN = np.array([[1.03, 0.02, -0.02], [0.02, 0.97, 0.02], [-0.02, 0.02, 1.03]])
OFFSET = np.array([0.05, -0.05, 0.05])


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_published_offsets_and_scale_factors_are_reproduced(number: int) -> None:
    found, fit = find_extremes(table(number)), fit_six_positions(table(number))
    for offset in (found.offset, fit.offset):
        np.testing.assert_allclose(offset, published("table_6_offset_V", number), atol=1e-4)
    np.testing.assert_allclose(found.scale, published("table_7_scale_V_per_g", number), atol=1e-4)
    np.testing.assert_allclose(np.diag(np.linalg.inv(fit.correction_matrix)), found.scale, atol=1e-9)
    np.testing.assert_allclose(found.type_a, TYPE_A_V / np.sqrt(2))


def test_the_uncertainty_of_the_extremes_is_that_of_both() -> None:
    poses = tuple(
        Pose(
            pose.mean, (0.0003, 0.0003, 0.0003) if pose.face and pose.face[0] == "+" else (0.0004,) * 3, 300, pose.face
        )
        for pose in place_on_faces(GAIN, OFFSET)
    )
    np.testing.assert_allclose(find_extremes(poses).type_a, 0.00025)


def test_misalignment_angles_of_table_1_are_reproduced_with_the_pairs_from_the_data() -> None:
    found = fit_six_positions(table(1)).misalignment_deg
    expected = {"x": [1.318, -1.579], "y": [0.533, -3.211], "z": [1.065, -3.218]}
    for axis, angles in expected.items():
        np.testing.assert_allclose(found[axis], angles, atol=5e-4)


def test_misalignment_angles_do_not_depend_on_the_order_of_the_poses() -> None:
    assert fit_six_positions(table(1)[::-1]).misalignment_deg == fit_six_positions(table(1)).misalignment_deg


def test_readings_in_g_without_misalignment_are_one_at_the_extremes() -> None:
    poses = table(1)
    found = apply_extremes(np.array([pose.mean for pose in poses]), find_extremes(poses))
    assert np.max(found, axis=0) == pytest.approx(1)
    assert np.min(found, axis=0) == pytest.approx(-1)


def test_only_the_outlier_of_table_3_is_flagged() -> None:
    flagged = {
        number: [warning.text for warning in fit_six_positions(table(number)).warnings if warning.is_outlier]
        for number in range(1, 6)
    }
    assert [number for number, texts in flagged.items() if texts] == [3]
    assert flagged[3] == ["U_x stands 9.1 mg off the other positions with -y or +y up; lay that face again"]


def test_an_earlier_session_decides_which_position_is_the_outlier() -> None:
    as_json = {number: tuple(pose.as_json() for pose in table(number)) for number in range(1, 6)}
    for old in (1, 2, 4, 5):
        (warning,) = find_changed_readings(as_json[3], as_json[old])
        assert "U_x with +y up" in warning.text
        for new in (1, 2, 4, 5):
            assert find_changed_readings(as_json[new], as_json[old]) == []


def test_injected_errors_are_recovered_exactly() -> None:
    fit = fit_six_positions(place_on_faces(GAIN, OFFSET))
    np.testing.assert_allclose(fit.correction_matrix, np.linalg.inv(GAIN), atol=1e-9)
    np.testing.assert_allclose(fit.offset, OFFSET, atol=1e-9)
    assert fit.residual_rms_g < 1e-9
    assert fit.warnings == ()


@pytest.mark.parametrize("face", FACES)
def test_a_missing_face_is_named(face: Face) -> None:
    poses = tuple(pose for pose in place_on_faces(GAIN, OFFSET) if pose.face != face)
    with pytest.raises(NotDeterminedError, match=rf"face \{face} missing: lay the sensor with \{face} up"):
        fit_six_positions(poses)


def test_repeats_are_averaged() -> None:
    poses = place_on_faces(GAIN, OFFSET)
    first = poses[0]
    higher = replace(first, mean=(first.mean[0] + 2e-4, *first.mean[1:]))
    both, averaged = (
        fit_six_positions((*poses[1:], *some))
        for some in ([first, higher], [replace(first, mean=(first.mean[0] + 1e-4, *first.mean[1:]))])
    )
    np.testing.assert_allclose(both.offset, averaged.offset, atol=1e-9)
    np.testing.assert_allclose(both.correction_matrix, averaged.correction_matrix, atol=1e-9)


def test_placement_is_in_the_covariance_of_the_off_diagonal_entries() -> None:
    """Off-diagonal entries contain the placement of a pair, half of two; offset and scale hardly any."""
    fit = fit_six_positions(place_on_faces(np.eye(3), np.zeros(3)), placement_u_deg=0.5)
    u = np.sqrt(np.diag(fit.covariance))
    across = np.radians(0.5) / np.sqrt(2)
    np.testing.assert_allclose(u[[1, 2, 3, 5, 6, 7]], across, rtol=1e-3)
    assert np.all(u[[0, 4, 8, 9, 10, 11]] < 0.02 * across)
    placement = next(row for row in fit.budget if row["source"] == "placement of the faces")
    assert placement["type"] == "B"
    assert placement["u_deg"] == pytest.approx(0.5 / np.sqrt(2), rel=1e-3)


@pytest.mark.slow
def test_the_covariance_is_that_of_many_sessions() -> None:
    """Monte Carlo of the placement alone, cross-axis included."""
    random = np.random.default_rng(5)
    fits = [fit_six_positions(place_on_faces(GAIN, OFFSET, random.normal(0, 0.1, (6, 3)))) for _ in range(700)]
    found = np.array([[*fit.correction_matrix.ravel(), *fit.offset] for fit in fits]).std(axis=0)
    stated = np.sqrt(np.mean([np.diag(fit.covariance) for fit in fits], axis=0))
    np.testing.assert_allclose(found, stated, rtol=0.15)


def test_a_placement_worse_than_stated_enlarges_the_uncertainty() -> None:
    random = np.random.default_rng(6)
    fit = fit_six_positions(place_on_faces(GAIN, OFFSET, random.normal(0, 1.0, (6, 3))), placement_u_deg=0.1)
    (warning,) = (warning for warning in fit.warnings if "the faces lay" in warning.text)
    assert "lay worse than the 0.1 deg stated" in warning.text
    assert np.sqrt(fit.covariance[1, 1]) > 3 * np.radians(0.1) / np.sqrt(2)


def test_poses_on_no_face_are_not_used_and_reported() -> None:
    x, y, z = (GAIN @ np.array([0.6, 0.8, 0.0]) + OFFSET).tolist()
    between = Pose((x, y, z), (1e-6, 1e-6, 1e-6), 300, None, used=False)
    fit = fit_six_positions((*place_on_faces(GAIN, OFFSET), between))
    np.testing.assert_allclose(fit.offset, OFFSET, atol=1e-9)
    assert fit.poses[-1] == between
    assert fit.warnings == (FitWarning("1 poses lay on no face and were not used"),)


def reading_g(pose_up: Array, quadratic_g: Array, cubic_g: Array) -> Array:
    """Return the reading of axes with these non-linear terms at a unit vector to the vertical, g."""
    return np.asarray(GAIN @ (pose_up + quadratic_g * pose_up**2 + cubic_g * pose_up**3) + OFFSET)


def non_linear_session(quadratic_g: Array, cubic_g: Array, noise_u: float = 2e-5) -> tuple[Pose, ...]:
    """Return the six faces and the twenty edges and corners of a sensor with non-linear axes and cross-axis sensitivity."""
    random = np.random.default_rng(3)
    poses = []
    for up in candidate_directions():
        x, y, z = (reading_g(up, quadratic_g, cubic_g) + noise_u * random.standard_normal(3)).tolist()
        face = find_face(up)
        poses.append(Pose((x, y, z), (noise_u, noise_u, noise_u), 300, face, used=face is not None))
    return tuple(poses)


def tilted(face: Face, angle_deg: float, axis: int) -> Pose:
    """Return a pose that is taken for a face, and lies off it by an angle about an axis."""
    turn = np.radians(angle_deg) * np.eye(3)[axis]
    up = FACE_DIRECTIONS[face] * np.cos(np.radians(angle_deg)) + np.cross(turn, FACE_DIRECTIONS[face])
    x, y, z = (GAIN @ up / np.linalg.norm(up) + OFFSET).tolist()
    return Pose((x, y, z), (1e-6, 1e-6, 1e-6), 300, face)


@pytest.mark.parametrize("angle_deg", [6.0, 10.0, 15.0, 20.0])
def test_a_pose_tilted_against_its_face_is_no_face_however_near_it_is_to_one(angle_deg: float) -> None:
    others = (tilted("+x", angle_deg, 1), tilted("-z", -angle_deg, 0), tilted("+y", angle_deg, 2))
    fit = fit_six_positions((*others, *place_on_faces(GAIN, OFFSET)))
    np.testing.assert_allclose(fit.offset, OFFSET, atol=1e-9)
    np.testing.assert_allclose(fit.correction_matrix, np.linalg.inv(GAIN), atol=1e-9)
    assert [(pose.face, pose.used) for pose in fit.poses[:3]] == [(None, False)] * 3
    assert [pose.used for pose in fit.poses[3:]] == [True] * 6


@pytest.mark.parametrize("face", FACES)
def test_a_face_with_a_tilted_pose_alone_is_missing(face: Face) -> None:
    across = 1 if face in {"+x", "-x"} else 0
    poses = tuple(pose for pose in place_on_faces(GAIN, OFFSET) if pose.face != face)
    with pytest.raises(NotDeterminedError, match=rf"face \{face} missing"):
        fit_six_positions((*poses, tilted(face, 12.0, across)))


def test_a_sensor_turned_in_its_housing_lies_on_all_faces() -> None:
    turn = np.radians(8.0)
    turned = GAIN @ np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    fit = fit_six_positions(place_on_faces(turned, OFFSET))
    np.testing.assert_allclose(fit.correction_matrix, np.linalg.inv(turned), atol=1e-9)
    assert all(pose.used for pose in fit.poses)


def test_planted_non_linearity_is_recovered_and_in_the_budget() -> None:
    quadratic_g, cubic_g = np.array([0.006, 0.0, -0.004]), np.array([0.0, 0.005, 0.0])
    poses = without_tilted_poses(non_linear_session(quadratic_g, cubic_g))
    between = tuple(pose for pose in poses if pose.face is None)
    faces = fit_six_positions(tuple(pose for pose in poses if pose.face is not None), placement_u_deg=0.01)
    found = find_non_linearity(between, faces.correction_matrix, np.array(faces.offset), faces.covariance)
    for value, u, planted in (
        (found.quadratic_g, found.u_quadratic_g, quadratic_g),
        (found.cubic_g, found.u_cubic_g, cubic_g),
    ):
        assert np.all(np.abs(value - planted) < 3 * u)
    assert np.all(found.u_quadratic_g < 1e-3)
    fit = fit_six_positions(poses, placement_u_deg=0.01)
    (warning,) = (warning for warning in fit.warnings if "non-linear" in warning.text)
    assert "x quadratic +" in warning.text
    row = next(row for row in fit.budget if row["source"] == "non-linearity")
    assert 0.005 < row["u_g"] < 0.010


def test_linear_axes_add_nothing_to_the_budget() -> None:
    fit = fit_six_positions(non_linear_session(np.zeros(3), np.zeros(3)), placement_u_deg=0.02)
    row = next(row for row in fit.budget if row["source"] == "non-linearity")
    assert row["u_g"] == 0
    (warning,) = fit.warnings
    assert "lay on no face" in warning.text
