"""The reference frame of a norm fit: three angles that no magnitude shows, from the parent or from the sensor's assembly."""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.record import CalibrationRecord
from gateway.numerics.array import Array


@dataclass(frozen=True, slots=True)
class ReferenceFrame:
    """Rotation of the symmetric matrix of a norm fit into the sensor's axes."""

    source: str
    """Origin of the frame, as the uncertainty budget names it."""
    rotation: Array
    """Rotation matrix, shape (3, 3)."""
    covariance_rad2: Array
    """Covariance of the rotation's angles about the three axes, shape (3, 3)."""


def nominal_frame(u_deg: float) -> ReferenceFrame:
    """Return the symmetric frame itself, with this standard uncertainty about each axis."""
    return ReferenceFrame("attitude of the frame in the housing", np.eye(3), np.radians(u_deg) ** 2 * np.eye(3))


def parent_frame(parent: CalibrationRecord, symmetric: Array) -> ReferenceFrame:
    """Return the frame of a parent record: the rotation that brings the symmetric matrix nearest to the parent's matrix."""
    matrix = np.array(parent.correction_matrix, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix @ np.linalg.inv(symmetric))
    relative_error_jacobian = np.kron(np.eye(3), np.linalg.inv(matrix).T)  # (1 + E) M: E by the entries of M
    angle_jacobian = np.array([_skew(axis).ravel() / 2 for axis in np.eye(3)]) @ relative_error_jacobian
    covariance = np.array(parent.covariance, dtype=np.float64)[:9, :9]
    return ReferenceFrame(
        source=f"attitude of the frame, as of record {parent.id}",
        rotation=np.asarray(left @ right),
        covariance_rad2=angle_jacobian @ covariance @ angle_jacobian.T,
    )


def rotation_covariance(matrix: Array, covariance_rad2: Array) -> Array:
    """Return the covariance that small rotations of a correction matrix with this covariance cause, shape (12, 12)."""
    jacobian = np.zeros((12, 3))
    jacobian[:9] = np.column_stack([(_skew(axis) @ matrix).ravel() for axis in np.eye(3)])
    return np.asarray(jacobian @ covariance_rad2 @ jacobian.T)


def _skew(vector: Array) -> Array:
    """Return the matrix of the cross product `vector` x ..., shape (3, 3)."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
