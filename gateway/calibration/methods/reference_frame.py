"""The frame of a norm fit: three angles that |m| does not see, from the record before it or from how parts are built."""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.poses.pose import Array
from gateway.calibration.record import CalibrationRecord


@dataclass(frozen=True, slots=True)
class Frame:
    """How the symmetric matrix of a norm fit is turned into the sensor's axes as the housing knows them."""

    source: str
    rotation: Array
    """Shape (3, 3)."""
    covariance_rad2: Array
    """Of a further small rotation, shape (3, 3)."""


def nominal_frame(u_deg: float) -> Frame:
    """The symmetric frame itself, with this standard uncertainty about each axis."""
    return Frame("attitude of the frame in the housing", np.eye(3), np.radians(u_deg) ** 2 * np.eye(3))


def frame_of(parent: CalibrationRecord, symmetric: Array) -> Frame:
    """The frame that the parent's record has found, or was zeroed to: the nearest rotation of `symmetric` to its matrix."""
    matrix = np.array(parent.correction_matrix, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix @ np.linalg.inv(symmetric))
    by_matrix = np.kron(np.eye(3), np.linalg.inv(matrix).T)  # of the error as a factor in front of the matrix
    turning = np.array([skew(axis).ravel() / 2 for axis in np.eye(3)]) @ by_matrix
    covariance = np.array(parent.covariance, dtype=np.float64)[:9, :9]
    return Frame(
        f"attitude of the frame, as of record {parent.id}", np.asarray(left @ right), turning @ covariance @ turning.T
    )


def rotation_covariance(matrix: Array, covariance_rad2: Array) -> Array:
    """Of a correction matrix that is turned by a small rotation with this covariance, shape (12, 12)."""
    root = np.zeros((12, 3))
    root[:9] = np.column_stack([(skew(axis) @ matrix).ravel() for axis in np.eye(3)])
    return np.asarray(root @ covariance_rad2 @ root.T)


def skew(vector: Array) -> Array:
    """The matrix of the cross product `vector` x ..., shape (3, 3)."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
