"""The calibration record: an affine correction with its evidence, immutable, identified by its hash."""

import hashlib
import json
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from gateway.errors import InputError

Number = int | float
"""Kept as it came: 0 must not become 0.0 on its way through, or the hash would no longer match."""
Row = Annotated[list[Number], Field(min_length=3, max_length=3)]
CovarianceRow = Annotated[list[Number], Field(min_length=12, max_length=12)]


class CalibrationError(InputError):
    """A calibration record cannot be used; the text says why in one line."""


class NotDeterminedError(CalibrationError):
    """The readings do not determine the calibration; the text names what is missing and the mend."""


class BudgetRow(BaseModel):
    """One contribution to the uncertainty of a corrected reading (GUM 5)."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    source: str
    type: Literal["A", "B"]
    u_g: Number = Field(ge=0)
    """Standard uncertainty of a component, the worst over the six faces."""
    u_deg: Number = Field(ge=0)
    """The same as an angle, across the vertical."""


class CalibrationRecord(BaseModel):
    """corrected_g = correction_matrix @ (raw - offset), in the sensor's axes.

    Fields with a default may be missing in records of another origin (a factory, an older version); what is missing stays
    missing when the record is written again, so that its hash holds.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    format: Literal[1]
    id: str = Field(min_length=1)
    device_id: str
    method: str
    created_utc: str
    software: str
    by: str
    parent: str | None
    unit: Literal["g", "V", "counts"]
    offset: Row
    correction_matrix: Annotated[list[Row], Field(min_length=3, max_length=3)]
    covariance: Annotated[list[CovarianceRow], Field(min_length=12, max_length=12)]
    prediction_interval_g: Number = Field(gt=0)
    temperature_c: dict[str, Number] | None
    thermal: dict[str, Any] | None = None
    """Coefficients of a thermal calibration, where there was one."""
    poses: list[dict[str, Any]] = []
    """Each as `Pose.as_json` gives it."""
    misalignment_deg: dict[str, list[Number]] | None = None
    """Per axis the two angles of 000 eq. 13-18, in the order of the source's positions, see `misalignment`."""
    residual_rms_g: Number | None = None
    condition_number: Number | None = None
    budget: list[BudgetRow] = []
    warnings: list[str] = []
    sha256: str

    @model_serializer(mode="wrap")
    def _as_made(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Only the fields that the record came with."""
        return {key: value for key, value in handler(self).items() if key in self.model_fields_set}

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.sha256 != content_hash(self.model_dump(mode="json")):
            raise ValueError("sha256 does not match the content; the record was changed after it was made")
        return self

    @property
    def u_zero_g_offset_g(self) -> NDArray[np.float64]:
        """Standard uncertainty of each axis' zero-g offset, shape (3,), g."""
        matrix = np.array(self.correction_matrix)
        offset_covariance = np.array(self.covariance)[9:, 9:]
        return np.sqrt(np.diag(matrix @ offset_covariance @ matrix.T))

    @property
    def u_scale_factor(self) -> NDArray[np.float64]:
        """Relative standard uncertainty of each axis' scale factor, shape (3,)."""
        diagonal = np.sqrt(np.diag(np.array(self.covariance)))[[0, 4, 8]]
        return np.asarray(diagonal / np.abs(np.diag(np.array(self.correction_matrix))))


def content_hash(record: dict[str, Any]) -> str:
    """SHA-256 of the canonical JSON (sorted keys, no blanks) of everything but the hash itself."""
    content = {key: value for key, value in record.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
