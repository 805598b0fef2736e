"""The calibration fit: the result of every method, with covariance, prediction interval, budget and misalignment angles.

The equations of the angles (Łuczak et al. 2022, eq. 13 to 18) as printed exchange the pairs of x and y: an axis is horizontal in
the pairs of faces of the two *other* axes. Order and sign are those of the source's positions: pair 1-2 is -x minus +x, pair 3-4
is +z minus -z, pair 5-6 is -y minus +y.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from gateway.calibration.poses.pose import Pose, temperature_range
from gateway.calibration.record import Number
from gateway.calibration.uncertainty import (
    Contribution,
    gravity_contribution,
    prediction_interval_g,
    reading_noise_g,
    temperature_contribution,
    total_covariance,
    uncertainty_budget,
)
from gateway.numerics.array import Array

PAIR_ORDER = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}
"""For each axis, the axes whose faces are its two horizontal pairs."""
PAIR_SIGN = (-1.0, -1.0, 1.0)
"""For each axis, the sign of the end that points up in the first position of its pair. Definition: signs."""


def misalignment_deg(sensitivity: Array) -> dict[str, list[float]]:
    """Return the two misalignment angles of each axis, degrees.

    `sensitivity`, shape (3, 3), raw units per g: its row is the axis that reads, its column the axis that points up.
    """
    ratio = np.clip(sensitivity / np.diag(sensitivity)[:, None], -1, 1)
    return {
        name: [float(np.degrees(np.arcsin(PAIR_SIGN[pair] * ratio[axis, pair]))) for pair in PAIR_ORDER[name]]
        for axis, name in enumerate("xyz")
    }


class WarningKind(StrEnum):
    """Subject of a warning."""

    NON_LINEARITY = "non-linearity"
    """An axis errs between its extremes."""
    OUTLIER = "outlier"
    """A reading that the other readings do not explain."""
    PLACEMENT = "placement"
    """The faces were placed worse than stated."""
    SCATTER = "scatter"
    """The magnitudes scatter more than the noise explains."""
    THERMAL = "thermal"
    """What a thermal model was learned from."""
    UNCHECKED = "unchecked"
    """There are no more poses than unknowns."""
    UNUSED_POSES = "unused poses"
    """Poses on no face."""
    ZEROING = "zeroing"
    """Zeroing has removed a sum of two errors, and by how much."""


@dataclass(frozen=True, slots=True)
class FitWarning:
    """A remark on a fit, for the person who decides on the record."""

    kind: WarningKind
    text: str

    def as_record_text(self) -> str:
        """Return the warning as the record stores it: an outlier with its kind in front, any other as text alone."""
        return f"{self.kind}: {self.text}" if self.kind is WarningKind.OUTLIER else self.text


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
