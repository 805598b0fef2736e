"""From what a method has found to a `CalibrationFit`: covariance, prediction interval and budget are made alike for all."""

from dataclasses import dataclass
from typing import Any

from gateway.calibration.methods.misalignment import misalignment_deg
from gateway.calibration.poses.pose import Array, Pose
from gateway.calibration.record import Number
from gateway.calibration.uncertainty import (
    Contribution,
    budget,
    gravity_contribution,
    noise_g,
    prediction_interval_g,
    temperature,
    temperature_contribution,
    total,
)

OUTLIER = "outlier:"
"""A fit's warning that begins so names a reading that does not fit the others."""


@dataclass(frozen=True, slots=True)
class CalibrationFit:
    """What a procedure found: the record's content but for who, when and for which device."""

    method: str
    offset: tuple[Number, Number, Number]
    correction_matrix: Array
    """Shape (3, 3), g per unit."""
    covariance: Array
    """Shape (12, 12): matrix rows, then offset."""
    prediction_interval_g: float
    poses: tuple[Pose, ...]
    temperature_c: dict[str, Number] | None
    misalignment_deg: dict[str, list[float]]
    residual_rms_g: float
    condition_number: float
    budget: tuple[dict[str, Any], ...]
    """Rows of the GUM budget: source, type (A or B), u_g, u_deg."""
    warnings: tuple[str, ...]


def assemble(
    method: str,
    *,
    matrix: Array,
    offset: Array,
    sensitivity: Array,
    contributions: tuple[Contribution, ...],
    poses: tuple[Pose, ...],
    residual_rms_g: float,
    condition_number: float,
    warnings: list[str],
) -> CalibrationFit:
    """A fit of resting poses. To the method's contributions come those of temperature and gravity.

    `sensitivity` is what the misalignment angles are taken from, shape (3, 3), unit per g.
    """
    used = tuple(pose for pose in poses if pose.used)
    contributions = (*contributions, temperature_contribution(used, matrix), gravity_contribution())
    covariance = total(contributions)
    x, y, z = offset.tolist()
    return CalibrationFit(
        method=method,
        offset=(x, y, z),
        correction_matrix=matrix,
        covariance=covariance,
        prediction_interval_g=prediction_interval_g(matrix, covariance, noise_g(used, matrix)),
        poses=poses,
        temperature_c=temperature(used),
        misalignment_deg=misalignment_deg(sensitivity),
        residual_rms_g=residual_rms_g,
        condition_number=condition_number,
        budget=budget(matrix, contributions),
        warnings=tuple(warnings),
    )
