"""The calibration record: an affine correction with its evidence and the name of its method, immutable, identified by its hash.

Its figure is series of values with uncertainties, which the certificate plots as they stand.
"""

import hashlib
import json
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from gateway.errors import ANSWER_IS_NO, InputError
from gateway.numerics.array import Array

Number = int | float
"""A number that keeps its type: 0 must not become 0.0, or the hash would no longer match."""
Row = Annotated[list[Number], Field(min_length=3, max_length=3)]
CovarianceRow = Annotated[list[Number], Field(min_length=12, max_length=12)]
Text = Annotated[str, Field(max_length=200)]
Values = Annotated[tuple[float, ...], Field(max_length=2000)]


class PoseMethod(StrEnum):
    """A calibration method that fits resting poses; a session and `plumbline calibrate` offer it."""

    SIX_POSITION = "six-position"
    NORM_FIT = "norm-fit"


ZEROING = "zero"
"""Method of a record that zeroing in place has made from its parent."""
THERMAL = "thermal"
"""Method of a record from temperature ramps on all six faces, with a thermal model."""
THERMAL_REST = "thermal-rest"
"""Method of a record with the thermal coefficient of the axis along the rope, learned at rest in service from its parent."""
INSTALLED = "installed"
"""Method of a record with what the free swings and rests of service show better than its parent."""
ROTATION = "rotation"
"""Method of records from full turns about horizontal axes."""
SINGLE_PARAMETER = "single-parameter"
"""Method of records for relative angles alone."""


class CalibrationError(InputError):
    """A calibration record cannot be used; the text states the reason in one line."""


class NotDeterminedError(CalibrationError):
    """The readings do not determine the calibration; the text states what is missing and how to obtain it."""

    exit_code = ANSWER_IS_NO


class BudgetEntry(BaseModel):
    """One contribution to the uncertainty of a corrected reading (GUM 5)."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    source: str
    type: Literal["A", "B"]
    u_g: Number = Field(ge=0)
    """Standard uncertainty of a component, largest over the six faces."""
    u_deg: Number = Field(ge=0)
    """Standard uncertainty of a tilt, from the components across the vertical."""


class CalibrationRecord(BaseModel):
    """corrected_g = correction_matrix @ (raw - offset), in the sensor's axes.

    Fields with a default may be missing in records of another origin (a factory, an older version). A missing field stays missing
    when the record is written again, so that its hash matches.
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
    """Coefficients of a thermal calibration; null if there was none."""
    poses: list[dict[str, Any]] = []
    """Poses, each as of `Pose.as_json`."""
    misalignment_deg: dict[str, list[Number]] | None = None
    """Two angles of each axis (Łuczak et al. 2022, eq. 13 to 18), in the order of `calibration_fit.PAIR_ORDER`."""
    residual_rms_g: Number | None = None
    condition_number: Number | None = None
    budget: list[BudgetEntry] = []
    warnings: list[str] = []
    sha256: str

    @model_serializer(mode="wrap")
    def _without_missing_fields(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in handler(self).items() if key in self.model_fields_set}

    @model_validator(mode="after")
    def _check_hash(self) -> Self:
        if self.sha256 != content_hash(self.model_dump(mode="json")):
            raise ValueError("sha256 does not match the content; the record was changed after it was made")
        return self

    @property
    def u_zero_g_offset_g(self) -> Array:
        """Standard uncertainty of the zero-g offset of each axis, g, shape (3,)."""
        matrix = np.array(self.correction_matrix)
        offset_covariance = np.array(self.covariance)[9:, 9:]
        return np.sqrt(np.diag(matrix @ offset_covariance @ matrix.T))

    @property
    def u_scale_factor(self) -> Array:
        """Relative standard uncertainty of the scale factor of each axis, shape (3,)."""
        diagonal = np.sqrt(np.diag(np.array(self.covariance)))[[0, 4, 8]]
        return np.asarray(diagonal / np.abs(np.diag(np.array(self.correction_matrix))))


def content_hash(record: dict[str, Any]) -> str:
    """Return the SHA-256 of the canonical JSON (sorted keys, no spaces) of everything except the hash itself."""
    content = {key: value for key, value in record.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def created_at(record: CalibrationRecord) -> datetime:
    """Return when a record was made, UTC if it has no time zone. Raises `CalibrationError` for a text that is no time."""
    try:
        made = datetime.fromisoformat(record.created_utc)
    except ValueError as error:
        raise CalibrationError(f"record {record.id}: created_utc {record.created_utc!r} is no ISO 8601 time") from error
    return made if made.tzinfo is not None else made.replace(tzinfo=UTC)


class FigureSeries(BaseModel):
    """One quantity over another; all tuples have the same length."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Text
    x: Values
    y: Values
    u: Values
    """Standard uncertainty of each y; 0 where none is drawn."""


class RecordFigure(BaseModel):
    """Figure of a method whose evidence is not a set of poses; a record stores it in its field `figure`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    title: Text
    x_label: Text
    y_label: Text
    series: Annotated[tuple[FigureSeries, ...], Field(min_length=1, max_length=4)]
    bounds: Annotated[tuple[float, ...], Field(max_length=4)] = ()
    """Heights of dashed lines: limits, intervals."""
    caption: Annotated[str, Field(max_length=400)] = ""
