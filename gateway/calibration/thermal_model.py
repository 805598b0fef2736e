"""The thermal model of a calibration record: zero-g offset and sensitivity against temperature, inside a measured range.

    reading = offset + offset_change(T) + (1 + scale_change(T)) * sensitivity * specific force

for each axis of the sensor, with polynomials in T - reference without a constant. Outside the measured range the model is held at
its ends.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.numerics.array import Array

Coefficients = Annotated[list[float], Field(min_length=1, max_length=2)]
Axis = Literal["x", "y", "z"]
AXES: tuple[Axis, Axis, Axis] = ("x", "y", "z")


class AxisThermalModel(BaseModel):
    """The two polynomials of one axis of the sensor."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    offset_per_c: Coefficients
    """Coefficients of T - reference and, where the data need it, of its square; raw units per °C and per °C²."""
    scale_per_c: Coefficients
    """The same of the relative change of the sensitivity, 1/°C and 1/°C²."""
    covariance: list[list[float]]
    """Covariance of the coefficients, those of the offset first."""

    @model_validator(mode="after")
    def _check_covariance(self) -> Self:
        size = len(self.offset_per_c) + len(self.scale_per_c)
        if [len(row) for row in self.covariance] != [size] * size:
            raise ValueError(f"covariance must be {size} x {size}")
        return self

    def change(self, from_reference_c: Array) -> tuple[Array, Array]:
        """Return the change of the offset, raw units, and the relative change of the sensitivity; shape of the argument."""
        return _polynomial(self.offset_per_c, from_reference_c), _polynomial(self.scale_per_c, from_reference_c)

    def u_change(self, from_reference_c: float) -> tuple[float, float]:
        """Return the standard uncertainties of both changes."""
        n_offset, n_scale = len(self.offset_per_c), len(self.scale_per_c)
        covariance = np.array(self.covariance)
        offset_row, scale_row = _powers(n_offset, from_reference_c), _powers(n_scale, from_reference_c)
        u_offset = np.sqrt(max(0.0, offset_row @ covariance[:n_offset, :n_offset] @ offset_row))
        u_scale = np.sqrt(max(0.0, scale_row @ covariance[n_offset:, n_offset:] @ scale_row))
        return float(u_offset), float(u_scale)

    def slopes(self, from_reference_c: float) -> tuple[float, float]:
        """Return the derivatives of both changes by temperature."""
        return _slope(self.offset_per_c, from_reference_c), _slope(self.scale_per_c, from_reference_c)


class ThermalModel(BaseModel):
    """The field `thermal` of a calibration record."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    source: Literal["ramp", "rest"]
    """Temperature ramps of all axes, or rest on the rope: then the axis along the rope carries the sum of offset and scale."""
    reference_c: float
    """Temperature at which offset and matrix of the record hold, °C."""
    min_c: float
    """Lowest measured temperature, °C."""
    max_c: float
    """Highest measured temperature, °C."""
    axes: dict[Axis, AxisThermalModel]
    summary: list[dict[str, Any]] = []
    """Coefficients in mg/°C and %/°C with intervals, limits and verdicts, for readers."""

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        if not self.min_c <= self.reference_c <= self.max_c or self.min_c == self.max_c:
            raise ValueError("needs min_c <= reference_c <= max_c, min_c below max_c")
        if set(self.axes) != set(AXES):
            raise ValueError("axes must be x, y and z")
        return self

    def to_reference(self, raw: Array, offset: Array, temperature_c: Array | float) -> Array:
        """Return readings, shape (n, 3), as the sensor would have read them at the reference temperature.

        `offset`, shape (3,), is that of the record; the temperature is one number or of shape (n,), NaN where it is not known:
        such readings stay as they are.
        """
        known_c = np.where(np.isnan(temperature_c), self.reference_c, temperature_c)
        from_reference_c = np.clip(known_c, self.min_c, self.max_c) - self.reference_c
        changes = [self.axes[axis].change(from_reference_c) for axis in AXES]
        offset_change = np.stack([change[0] for change in changes], axis=-1)
        scale = 1 + np.stack([change[1] for change in changes], axis=-1)
        return np.asarray(offset + (raw - offset - offset_change) / scale)

    def u_change(self) -> tuple[Array, Array]:
        """Return the largest standard uncertainties in the range by axis: of the offset, raw units, and of the scale, (3,)."""
        ends_c = (self.min_c - self.reference_c, self.max_c - self.reference_c)
        found = np.array([[self.axes[axis].u_change(end_c) for end_c in ends_c] for axis in AXES])
        return found[:, :, 0].max(axis=1), found[:, :, 1].max(axis=1)

    def end_slopes(self) -> tuple[Array, Array]:
        """Return the steepest slopes at the ends of the range by axis: of the offset, raw units/°C, and of the scale, (3,)."""
        ends_c = (self.min_c - self.reference_c, self.max_c - self.reference_c)
        found = np.abs([[self.axes[axis].slopes(end_c) for end_c in ends_c] for axis in AXES])
        return found[:, :, 0].max(axis=1), found[:, :, 1].max(axis=1)


def thermal_model(record: CalibrationRecord) -> ThermalModel | None:
    """Return the thermal model of a record, None if it has none. Raises `CalibrationError` for one that cannot be used."""
    if record.thermal is None:
        return None
    try:
        return ThermalModel.model_validate(record.thermal)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, ("thermal", *first["loc"])))
        raise CalibrationError(f"calibration {record.id}: {place}: {first['msg']}; calibrate again") from error


def holds_at_c(temperature_c: Mapping[str, float] | None, thermal: Mapping[str, Any] | None) -> float | None:
    """Return the temperature at which offset and matrix of a record or fit hold, from its two fields; None: not known."""
    if thermal is not None:
        return float(thermal["reference_c"])
    return None if temperature_c is None else float(temperature_c["mean"])


def correction_at(record: CalibrationRecord, temperature_c: float | None) -> tuple[Array, Array]:
    """Return matrix, (3, 3), and offset, (3,), of a record at a temperature; None, or no thermal model: those of the record.

    Raises `CalibrationError` for a model that cannot be used.
    """
    matrix, offset = (np.array(values, dtype=np.float64) for values in (record.correction_matrix, record.offset))
    model = thermal_model(record)
    if model is None or temperature_c is None:
        return matrix, offset
    from_reference_c = np.clip(np.array(temperature_c), model.min_c, model.max_c) - model.reference_c
    changes = [model.axes[axis].change(from_reference_c) for axis in AXES]
    offset_change, scale_change = (np.array([change[part] for change in changes]) for part in (0, 1))
    return matrix / (1 + scale_change), offset + offset_change


def _powers(count: int, value: float) -> Array:
    return np.array([value ** (power + 1) for power in range(count)])


def _polynomial(coefficients: list[float], value: Array) -> Array:
    return np.asarray(np.polyval([*coefficients[::-1], 0.0], value))


def _slope(coefficients: list[float], value: float) -> float:
    return float(sum((power + 1) * coefficient * value**power for power, coefficient in enumerate(coefficients)))
