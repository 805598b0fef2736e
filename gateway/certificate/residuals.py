"""Residual of each pose after the correction: |m| - 1 g, which is zero at rest in any attitude."""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.calibration.record import CalibrationRecord

Three = tuple[float, float, float]


class _RecordedPose(BaseModel):
    """Fields of a pose that its residual needs."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)

    mean: Three
    type_a: Three = Field(default=(0.0, 0.0, 0.0))
    face: str | None = None
    used: bool = True


@dataclass(frozen=True, slots=True)
class PoseResidual:
    """Residual of one pose."""

    number: int
    """From 1, in the order of the record."""
    face: str | None
    used: bool
    residual_g: float
    u_g: float
    """Type A standard uncertainty of the pose's mean along its vertical."""

    @property
    def ratio(self) -> float:
        """Residual over uncertainty; infinite where none is stated."""
        return abs(self.residual_g) / self.u_g if self.u_g > 0 else math.inf


def residuals(record: CalibrationRecord) -> tuple[PoseResidual, ...]:
    """Return the residual of every pose that can be read; gravity is 1 g by definition."""
    matrix = np.array(record.correction_matrix, dtype=np.float64)
    offset = np.array(record.offset, dtype=np.float64)
    found = []
    for number, entry in enumerate(record.poses, 1):
        try:
            pose = _RecordedPose.model_validate(entry)
        except ValidationError:
            continue  # the certificate counts the poses that are not shown
        corrected_g = matrix @ (np.array(pose.mean) - offset)
        norm_g = float(np.linalg.norm(corrected_g))
        if not 0 < norm_g < math.inf:
            continue
        u_g = float(np.linalg.norm(corrected_g / norm_g @ matrix * pose.type_a))
        if not math.isfinite(u_g):
            continue
        found.append(PoseResidual(number, pose.face, pose.used, norm_g - 1, u_g))
    return tuple(found)
