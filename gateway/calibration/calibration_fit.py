"""The calibration fit: the result of every method, with contributions, covariance, prediction interval and budget (GUM 5).

The parameters are the rows of the correction matrix (9), then the offset (3).

The equations of the misalignment angles (Łuczak et al. 2022, eq. 13 to 18) as printed exchange the pairs of x and y: an axis is
horizontal in the pairs of faces of the two *other* axes. Order and sign are those of the source's positions: pair 1-2 is -x minus
+x, pair 3-4 is +z minus -z, pair 5-6 is -y minus +y.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gateway.calibration.pose import FACE_DIRECTIONS, Pose, temperature_range
from gateway.calibration.record import Number
from gateway.numerics.array import Array

K_PREDICTION = 3.0
"""Coverage factor of the prediction interval (Łuczak et al. 2022, sec. 4): 0.3 % of the readings at rest exceed it."""
K_OUTLIER = 5.0
"""Standard deviations by which an outlier deviates. Basis: a choice; noise reaches it once in 1.7 million readings, and a wrong
face deviates by more."""
MAX_CONDITION_NUMBER = 30.0
"""Largest condition number of the design of a fit. Basis: poses in all directions give 2 to 4."""
FACE_MATRIX = np.array(list(FACE_DIRECTIONS.values()))
"""Unit vectors to the vertical on the six faces, shape (6, 3)."""
OFFSET_TEMPERATURE_COEFFICIENT_G_PER_C = 0.5e-3
"""Standard uncertainty of the temperature coefficient of a zero-g offset, g/°C; data sheets state 0.15 to 1.2 mg/°C."""
PAIR_ORDER = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}
"""For each axis, the axes whose faces are its two horizontal pairs."""
PAIR_SIGN = (-1.0, -1.0, 1.0)
"""For each axis, the sign of the end that points up in the first position of its pair. Definition: signs."""


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


def misalignment_deg(sensitivity: Array) -> dict[str, list[float]]:
    """Return the two misalignment angles of each axis, degrees.

    `sensitivity`, shape (3, 3), raw units per g: its row is the axis that reads, its column the axis that points up.
    """
    ratio = np.clip(sensitivity / np.diag(sensitivity)[:, None], -1, 1)
    return {
        name: [float(np.degrees(np.arcsin(PAIR_SIGN[pair] * ratio[axis, pair]))) for pair in PAIR_ORDER[name]]
        for axis, name in enumerate("xyz")
    }


@dataclass(frozen=True, slots=True)
class FitWarning:
    """A remark on a fit, for the person who decides on the record."""

    text: str
    is_outlier: bool = False
    """A reading that the other readings do not explain: putting the record in force needs a reason."""

    def as_record_text(self) -> str:
        """Return the warning as the record stores it: an outlier with this word in front."""
        return f"outlier: {self.text}" if self.is_outlier else self.text


@dataclass(frozen=True, slots=True)
class CalibrationFit:
    """Content of a calibration record, without device, person and time."""

    method: str
    offset: tuple[Number, Number, Number]
    """Reading at zero g, raw units."""
    correction_matrix: Array
    """Correction matrix, g per raw unit, shape (3, 3)."""
    covariance: Array
    """Covariance of the matrix by rows, then of the offset, shape (12, 12)."""
    prediction_interval_g: float
    poses: tuple[Pose, ...]
    temperature_c: dict[str, Number] | None
    """Mean, minimum and maximum of the poses' temperatures."""
    misalignment_deg: dict[str, list[float]]
    residual_rms_g: float
    condition_number: float
    """Condition number of the design of the fit."""
    budget: tuple[dict[str, Any], ...]
    """Rows of the uncertainty budget (GUM): source, type (A or B), u_g, u_deg."""
    warnings: tuple[FitWarning, ...]
    thermal: dict[str, Any] | None = None
    """The thermal model as JSON; None: nothing corrects for temperature."""


def assemble_fit(
    method: str,
    *,
    matrix: Array,
    offset: Array,
    sensitivity: Array,
    contributions: tuple[Contribution, ...],
    poses: tuple[Pose, ...],
    residual_rms_g: float,
    condition_number: float,
    warnings: list[FitWarning],
) -> CalibrationFit:
    """Return the fit of resting poses; the contributions of temperature and gravity are added to those of the method.

    The misalignment angles are computed from `sensitivity`, shape (3, 3), raw units per g.
    """
    used = tuple(pose for pose in poses if pose.used)
    contributions = (*contributions, temperature_contribution(used, matrix), gravity_contribution())
    covariance = total_covariance(contributions)
    x, y, z = offset.tolist()
    return CalibrationFit(
        method=method,
        offset=(x, y, z),
        correction_matrix=matrix,
        covariance=covariance,
        prediction_interval_g=prediction_interval_g(matrix, covariance, reading_noise_g(used, matrix)),
        poses=poses,
        temperature_c=temperature_range(pose.temperature_c for pose in used),
        misalignment_deg=misalignment_deg(sensitivity),
        residual_rms_g=residual_rms_g,
        condition_number=condition_number,
        budget=uncertainty_budget(matrix, contributions),
        warnings=tuple(warnings),
    )
