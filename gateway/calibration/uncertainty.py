"""Uncertainty of a calibration: contributions, covariance, budget and prediction interval (GUM 5).

The parameters are the rows of the correction matrix (9), then the offset (3).
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gateway.calibration.poses.faces import FACE_DIRECTIONS
from gateway.calibration.poses.pose import Pose, temperature_range
from gateway.numerics.array import Array

K_PREDICTION = 3.0
"""Coverage factor of the prediction interval (Łuczak et al. 2022, sec. 4): 0.3 % of the readings at rest exceed it."""
FACE_MATRIX = np.array(list(FACE_DIRECTIONS.values()))
"""Unit vectors to the vertical on the six faces, shape (6, 3)."""
OFFSET_TEMPERATURE_COEFFICIENT_G_PER_C = 0.5e-3
"""Standard uncertainty of the temperature coefficient of a zero-g offset, g/°C; data sheets state 0.15 to 1.2 mg/°C."""


@dataclass(frozen=True, slots=True)
class Contribution:
    """One source of uncertainty."""

    source: str
    type: Literal["A", "B"]
    covariance: Array
    """Covariance of the parameters that the source causes, shape (12, 12)."""


def face_jacobians(matrix: Array) -> Array:
    """Return the derivatives of the corrected readings on the six faces by the parameters, shape (6, 3, 12)."""
    raw = np.linalg.inv(matrix) @ FACE_MATRIX.T
    jacobians = np.zeros((6, 3, 12))
    for axis in range(3):
        jacobians[:, axis, 3 * axis : 3 * axis + 3] = raw.T
    jacobians[:, :, 9:] = -matrix
    return jacobians


def reading_covariance(matrix: Array, covariance: Array, direction: Array) -> Array:
    """Return the covariance of a corrected reading of 1 g along `direction`, in the sensor's axes, shape (3, 3)."""
    jacobian = np.hstack([np.kron(np.eye(3), np.linalg.solve(matrix, direction)), -matrix])
    return np.asarray(jacobian @ covariance @ jacobian.T)


def total_covariance(contributions: tuple[Contribution, ...]) -> Array:
    """Return the sum of the contributions' covariances, exactly symmetric, shape (12, 12)."""
    covariance = np.sum([contribution.covariance for contribution in contributions], axis=0)
    return np.asarray((covariance + covariance.T) / 2)


def uncertainty_budget(matrix: Array, contributions: tuple[Contribution, ...]) -> tuple[dict[str, Any], ...]:
    """Return the rows of the budget: standard uncertainty of a corrected component and of a tilt, largest over the six faces."""
    jacobians = face_jacobians(matrix)
    return tuple(
        {"source": entry.source, "type": entry.type, "u_g": u_g, "u_deg": u_deg}
        for entry in contributions
        for u_g, u_deg in [_largest_uncertainty(jacobians, entry.covariance)]
    )


def prediction_interval_g(matrix: Array, covariance: Array, noise_g: float) -> float:
    """Return the largest expected deviation of |m| of one reading at rest from 1 g (Łuczak n.d., eq. 14, dm), g.

    The largest of the six faces counts.
    """
    along = np.einsum("fa,fap->fp", FACE_MATRIX, face_jacobians(matrix))
    variances = np.einsum("fp,pq,fq->f", along, covariance, along)
    return K_PREDICTION * float(np.sqrt(max(0.0, float(variances.max())) + noise_g**2))


def reading_noise_g(poses: tuple[Pose, ...], matrix: Array) -> float:
    """Return the standard deviation of one corrected reading along its noisiest axis, g."""
    sigmas = [pose.reading_sigma for pose in poses]
    return float(np.max(np.linalg.norm(matrix, axis=1) * np.sqrt(np.mean(np.square(sigmas), axis=0))))


def temperature_contribution(poses: tuple[Pose, ...], matrix: Array) -> Contribution:
    """Return the contribution of the offset's thermal drift between the poses, rectangular over the range (GUM 4.3.7)."""
    covariance = np.zeros((12, 12))
    if (temperature_c := temperature_range(pose.temperature_c for pose in poses)) is not None:
        u_g = OFFSET_TEMPERATURE_COEFFICIENT_G_PER_C * (temperature_c["max"] - temperature_c["min"]) / np.sqrt(12)
        inverse = np.linalg.inv(matrix)
        covariance[9:, 9:] = u_g**2 * inverse @ inverse.T
    return Contribution("temperature spread", "B", covariance)


def gravity_contribution() -> Contribution:
    """Return the contribution of gravity, which is zero: the unit is the local g (Łuczak et al. 2022, sec. 4)."""
    return Contribution("gravity: the unit is the local g", "B", np.zeros((12, 12)))


def _largest_uncertainty(jacobians: Array, covariance: Array) -> tuple[float, float]:
    variance = np.clip(((jacobians @ covariance) * jacobians).sum(axis=2), 0, None)
    across = np.where(FACE_MATRIX == 0, variance, 0.0)
    return float(np.sqrt(variance.max())), float(np.degrees(np.arcsin(min(np.sqrt(across.max()), 1.0))))
