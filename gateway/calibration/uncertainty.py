"""From contributions to covariance, GUM budget and prediction interval. Parameters: matrix rows (9), then offset (3)."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gateway.calibration.poses.faces import FACE_DIRECTIONS
from gateway.calibration.poses.pose import Array, Pose

COVERAGE = 3.0
"""Of the prediction interval, in standard deviations (000 sec. 4): a part at rest is seldom refused."""
FACE_MATRIX = np.array(list(FACE_DIRECTIONS.values()))
"""Shape (6, 3)."""
OFFSET_TEMPCO_G_PER_C = 0.5e-3
"""Standard uncertainty of a zero-g offset's temperature coefficient where nothing better is known (datasheets: 0.15-1.2 mg/C)."""


@dataclass(frozen=True, slots=True)
class Contribution:
    """One source of uncertainty."""

    source: str
    type: Literal["A", "B"]
    covariance: Array
    """Shape (12, 12)."""


def face_jacobians(matrix: Array) -> Array:
    """Change of the corrected readings at the six faces with the parameters, shape (6, 3, 12)."""
    raw = np.linalg.inv(matrix) @ FACE_MATRIX.T
    jacobians = np.zeros((6, 3, 12))
    for axis in range(3):
        jacobians[:, axis, 3 * axis : 3 * axis + 3] = raw.T
    jacobians[:, :, 9:] = -matrix
    return jacobians


def reading_covariance(matrix: Array, covariance: Array, direction: Array) -> Array:
    """Covariance of a corrected reading of 1 g along `direction`, shape (3, 3), in the sensor's axes."""
    jacobian = np.hstack([np.kron(np.eye(3), np.linalg.solve(matrix, direction)), -matrix])
    return np.asarray(jacobian @ covariance @ jacobian.T)


def total(contributions: tuple[Contribution, ...]) -> Array:
    """Covariance of all sources together, shape (12, 12), exactly symmetric."""
    covariance = np.sum([contribution.covariance for contribution in contributions], axis=0)
    return np.asarray((covariance + covariance.T) / 2)


def budget(matrix: Array, contributions: tuple[Contribution, ...]) -> tuple[dict[str, Any], ...]:
    """Rows of the GUM budget: standard uncertainty of a corrected component and of a tilt, the worst over the six faces."""
    jacobians = face_jacobians(matrix)
    return tuple(
        {"source": entry.source, "type": entry.type, "u_g": u_g, "u_deg": u_deg}
        for entry in contributions
        for u_g, u_deg in [_worst(jacobians, entry.covariance)]
    )


def prediction_interval_g(matrix: Array, covariance: Array, noise_g: float) -> float:
    """dm of 001 eq. 14: how far |m| of one reading at rest may be from 1, the worst over the six faces, in g."""
    along = np.einsum("fa,fap->fp", FACE_MATRIX, face_jacobians(matrix))
    variances = np.einsum("fp,pq,fq->f", along, covariance, along)
    return COVERAGE * float(np.sqrt(max(0.0, float(variances.max())) + noise_g**2))


def noise_g(poses: tuple[Pose, ...], matrix: Array) -> float:
    """Standard deviation of a single corrected reading along its worst axis, g."""
    readings = [pose.noise or tuple(u * np.sqrt(pose.count) for u in pose.type_a) for pose in poses]
    return float(np.max(np.linalg.norm(matrix, axis=1) * np.sqrt(np.mean(np.square(readings), axis=0))))


def temperature(poses: tuple[Pose, ...]) -> dict[str, int | float] | None:
    """Mean, least and greatest temperature of the poses; None where it was not read."""
    known = [pose.temperature_c for pose in poses if pose.temperature_c is not None]
    if not known:
        return None
    return {"mean": float(np.mean(known)), "min": min(known), "max": max(known)}


def temperature_contribution(poses: tuple[Pose, ...], matrix: Array) -> Contribution:
    """The offset's drift while the poses were taken: rectangular over the spread of temperature (GUM 4.3.7)."""
    covariance = np.zeros((12, 12))
    if (seen := temperature(poses)) is not None:
        u_g = OFFSET_TEMPCO_G_PER_C * (seen["max"] - seen["min"]) / np.sqrt(12)
        inverse = np.linalg.inv(matrix)
        covariance[9:, 9:] = u_g**2 * inverse @ inverse.T
    return Contribution("temperature spread", "B", covariance)


def gravity_contribution() -> Contribution:
    """None: the unit is the local g itself (000 sec. 4)."""
    return Contribution("gravity: the unit is the local g", "B", np.zeros((12, 12)))


def _worst(jacobians: Array, covariance: Array) -> tuple[float, float]:
    variance = np.clip(((jacobians @ covariance) * jacobians).sum(axis=2), 0, None)
    across = np.where(FACE_MATRIX == 0, variance, 0.0)
    return float(np.sqrt(variance.max())), float(np.degrees(np.arcsin(min(np.sqrt(across.max()), 1.0))))
