"""The correction in force: from raw readings to specific force in the housing frame, with its uncertainty."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import AxesMap
from devices.block import DeviceInfo
from gateway.calibration.calibration_fit import reading_covariance
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.thermal_model import ThermalModel, thermal_model
from gateway.messages import CalibrationStatus
from gateway.numerics.array import Array

UNCALIBRATED_SCALE_FACTOR_U = 0.03
"""Relative standard uncertainty of a nominal sensitivity without further information. Basis: data sheets state the sensitivity
within some per cent."""
UNCALIBRATED_CROSS_AXIS_U = 0.01
"""Standard uncertainty of the cross-axis sensitivity of an uncalibrated sensor, relative. Basis: data sheets state 1 to 2 %."""
UNCALIBRATED_OFFSET_LIMIT_G = 0.15
"""Limit of the zero-g offset, g, of a sensor without a limit in its data sheet."""
ZERO_G_OFFSET_LIMIT_G_PER_K = 1e-3
"""Limit of the temperature coefficient of the zero-g offset, g/K, of a sensor without a limit in its data sheet."""
SCALE_FACTOR_LIMIT_PER_K = 3e-4
"""Limit of the temperature coefficient of the scale factor, 1/K, of a sensor without a limit in its data sheet."""
RECORDED_NORM_ERROR_G = 0.01
"""Permissible error of |m|, g, of a recording in g that brings no calibration record. Basis: a choice; a calibrated sensor errs
by less, and 0.01 g across is 0.6 degrees."""
K_UNCALIBRATED = 2.0
"""Coverage factor of the permissible error of |m| of an uncalibrated sensor. Definition: about 95 % (GUM 6.3)."""


def housing_rotation(axes: AxesMap) -> Array:
    """Return the rotation from the sensor's to the housing's axes, shape (3, 3)."""
    rotation = np.zeros((3, 3))
    for housing_axis, (sensor_axis, sign) in enumerate(axes):
        rotation[housing_axis, sensor_axis] = sign
    return rotation


@dataclass(frozen=True, slots=True)
class Correction:
    """An affine correction: specific_force_g = raw @ gain.T + bias_g, in the housing frame."""

    status: CalibrationStatus
    calibration_id: str | None
    gain: Array
    """Gain, g per raw unit, shape (3, 3)."""
    bias_g: Array
    """Bias, g, shape (3,)."""
    u_zero_g_offset_g: Array
    """Standard uncertainty by housing axis, g, shape (3,): of a reading at rest across the rope, the axes' attitude included."""
    u_scale_factor: Array
    """Relative standard uncertainty of the scale factor by housing axis, shape (3,)."""
    permissible_norm_error_g: float
    """Largest plausible deviation of |m| from 1 g at rest (Łuczak n.d., eq. 14, dm)."""
    text: str
    record: dict[str, Any] | None = None
    """The calibration record, if there is one."""
    u_cross_axis: float = 0.0
    """Standard uncertainty of the cross-axis sensitivity, relative."""
    calibrated_c: tuple[float, float] | None = None
    """Lowest and highest temperature of the calibration, °C; None: not known. Beyond them the uncertainty grows."""
    u_zero_g_offset_g_per_k: float = 0.0
    """Standard uncertainty of the zero-g offset's temperature coefficient, g/K, on every axis."""
    u_scale_factor_per_k: float = 0.0
    """Standard uncertainty of the scale factor's temperature coefficient, 1/K, on every axis."""
    thermal: ThermalModel | None = None
    """Correction of the readings for temperature; None: the calibration has none."""
    offset: Array = field(default_factory=lambda: np.zeros(3))
    """Reading at zero g to which the thermal model refers, raw units, shape (3,)."""

    def apply(self, raw: NDArray[np.int32] | Array, temperature_c: Array | float | None = None) -> Array:
        """Return the specific force in the housing frame, g, shape (n, 3).

        The temperature, °C, is that of all readings or of each, shape (n,), NaN where it is not known.
        """
        readings = raw.astype(np.float64)
        if self.thermal is not None and temperature_c is not None:
            readings = self.thermal.to_reference(readings, self.offset, temperature_c)
        force_g: Array = readings @ self.gain.T
        force_g += self.bias_g
        return force_g

    def u_force_g(self, force_g: Array, temperature_c: float | None = None) -> Array:
        """Return the standard uncertainty of a reading in g by axis, shape (3,), from offset, scale factor and temperature."""
        u_offset_g, u_scale_factor = self._u_at(self.kelvin_beyond(temperature_c))
        return np.asarray(np.hypot(u_offset_g, u_scale_factor * force_g), dtype=np.float64)

    def kelvin_beyond(self, temperature_c: float | None) -> int:
        """Return the distance of a temperature from those of the calibration, whole kelvins rounded up.

        An unknown temperature is anywhere in the range of a thermal model, which cannot be applied; without a model it counts 0.
        """
        if self.calibrated_c is None:
            return 0
        low_c, high_c = self.calibrated_c
        if temperature_c is None:
            if self.thermal is None:
                return 0
            reference_c = self.thermal.reference_c
            return math.ceil(max(reference_c - low_c, high_c - reference_c))
        return max(0, math.ceil(low_c - temperature_c), math.ceil(temperature_c - high_c))

    def widened_by(self, kelvin: float) -> "Correction":
        """Return the correction with its uncertainty at this distance from the temperatures of the calibration (type B)."""
        u_offset_g, u_scale_factor = self._u_at(kelvin)
        return replace(self, u_zero_g_offset_g=u_offset_g, u_scale_factor=u_scale_factor)

    def _u_at(self, kelvin: float) -> tuple[Array, Array]:
        """Return the standard uncertainties of zero-g offset, g, and scale factor at this distance."""
        if kelvin == 0:
            return self.u_zero_g_offset_g, self.u_scale_factor
        return (
            np.hypot(self.u_zero_g_offset_g, kelvin * self.u_zero_g_offset_g_per_k),
            np.hypot(self.u_scale_factor, kelvin * self.u_scale_factor_per_k),
        )

    def range_warnings(self, temperature_c: float | None) -> tuple[str, ...]:
        """Return a warning for people if a temperature is outside those of the calibration."""
        if self.calibrated_c is None or not self.kelvin_beyond(temperature_c):
            return ()
        low_c, high_c = self.calibrated_c
        if temperature_c is None:
            return ("widened: the temperature is not known, the thermal model is not applied",)
        return (f"widened: at {temperature_c:.0f} °C, calibrated at {low_c:.0f} to {high_c:.0f} °C",)


def widest(corrections: Sequence[Correction]) -> Correction:
    """Return the first correction with the largest uncertainty of all, each quantity by itself, and the texts of all."""
    first, *others = corrections
    if not others:
        return first
    return replace(
        first,
        u_zero_g_offset_g=np.max([each.u_zero_g_offset_g for each in corrections], axis=0),
        u_scale_factor=np.max([each.u_scale_factor for each in corrections], axis=0),
        u_cross_axis=max(each.u_cross_axis for each in corrections),
        permissible_norm_error_g=max(each.permissible_norm_error_g for each in corrections),
        text="; then ".join(each.text for each in corrections),
    )


def correction_for(info: DeviceInfo, axes: AxesMap, stored: CalibrationRecord | None) -> Correction:
    """Return the best correction of a device: by its stored record, its factory record, or the data sheet.

    Raises `CalibrationError` if the record is for another device or another unit of raw input.
    """
    housing_from_sensor = housing_rotation(axes)
    if stored is not None:
        return _by_record("calibrated", stored, info, housing_from_sensor)
    if info.factory_calibration is not None:
        factory_record = CalibrationRecord.model_validate(info.factory_calibration)
        return _by_record("factory", factory_record, info, housing_from_sensor)
    if info.calibrated_source:
        return _as_recorded(housing_from_sensor)
    return _by_data_sheet(info, housing_from_sensor)


def _by_record(
    status: CalibrationStatus, record: CalibrationRecord, info: DeviceInfo, housing_from_sensor: Array
) -> Correction:
    if record.device_id != info.device_id:
        raise CalibrationError(f"calibration {record.id} belongs to {record.device_id}, not to {info.device_id}")
    if record.unit != info.unit:
        raise CalibrationError(
            f"calibration {record.id} is for raw input in {record.unit}, the device delivers {info.unit}"
        )
    gain = housing_from_sensor @ np.array(record.correction_matrix)
    u_offset_g_per_k = _rectangular_u(info.zero_g_offset_g_per_k, ZERO_G_OFFSET_LIMIT_G_PER_K)
    u_scale_per_k = _rectangular_u(info.scale_factor_per_k, SCALE_FACTOR_LIMIT_PER_K)
    correction = Correction(
        status=status,
        calibration_id=record.id,
        gain=gain,
        bias_g=-gain @ np.array(record.offset),
        u_zero_g_offset_g=_rest_u_g(record, housing_from_sensor),
        u_scale_factor=np.abs(housing_from_sensor) @ record.u_scale_factor,
        permissible_norm_error_g=record.prediction_interval_g,
        text=f"{status}: record {record.id}, {record.method}, {record.created_utc[:10]}",
        record=record.model_dump(mode="json"),
        u_cross_axis=_cross_axis_u(record),
        calibrated_c=_temperature_limits_c(record),
        u_zero_g_offset_g_per_k=u_offset_g_per_k,
        u_scale_factor_per_k=u_scale_per_k,
    )
    model = thermal_model(record)
    return correction if model is None else _with_thermal_model(correction, model, record, housing_from_sensor)


def _with_thermal_model(
    correction: Correction, model: ThermalModel, record: CalibrationRecord, housing_from_sensor: Array
) -> Correction:
    """Return the correction with the model, its uncertainty, and its slope as the uncertainty beyond its range."""
    g_per_raw = np.abs(np.diag(np.array(record.correction_matrix)))
    to_housing = np.abs(housing_from_sensor)
    u_offset, u_scale = model.u_change()
    slope, scale_slope = model.end_slopes()
    return replace(
        correction,
        u_zero_g_offset_g=np.hypot(correction.u_zero_g_offset_g, to_housing @ (g_per_raw * u_offset)),
        u_scale_factor=np.hypot(correction.u_scale_factor, to_housing @ u_scale),
        calibrated_c=(model.min_c, model.max_c),
        u_zero_g_offset_g_per_k=math.hypot(correction.u_zero_g_offset_g_per_k, float((g_per_raw * slope).max())),
        u_scale_factor_per_k=math.hypot(correction.u_scale_factor_per_k, float(scale_slope.max())),
        thermal=model,
        offset=np.array(record.offset, dtype=np.float64),
    )


def _cross_axis_u(record: CalibrationRecord) -> float:
    """Return the largest relative standard uncertainty of the six off-diagonal entries."""
    deviation = np.sqrt(np.diag(np.array(record.covariance))[:9]).reshape(3, 3)
    relative = deviation / np.abs(np.diag(np.array(record.correction_matrix)))[:, None]
    return float((relative * (1 - np.eye(3))).max())


def _temperature_limits_c(record: CalibrationRecord) -> tuple[float, float] | None:
    known = record.temperature_c
    return None if known is None else (float(known["min"]), float(known["max"]))


def _rectangular_u(limit: float | None, default: float) -> float:
    """Return the standard uncertainty of a rectangular distribution within a limit (GUM 4.3.7)."""
    return (default if limit is None else limit) / math.sqrt(3)


def _rest_u_g(record: CalibrationRecord, housing_from_sensor: Array) -> Array:
    """Return the standard uncertainty of a reading at rest on the rope, g, shape (3,).

    Across the rope: of zero-g offset, cross-axis sensitivity and attitude with their correlations, because zeroing in place
    determines their sum better than each of them. Along the rope: of the zero-g offset alone.
    """
    matrix, covariance = np.array(record.correction_matrix), np.array(record.covariance)
    hanging = reading_covariance(matrix, covariance, housing_from_sensor[2])
    at_rest = housing_from_sensor @ hanging @ housing_from_sensor.T
    u_g = np.sqrt(np.clip(np.diag(at_rest), 0, None))
    u_g[2] = (np.abs(housing_from_sensor) @ record.u_zero_g_offset_g)[2]
    return u_g


def _as_recorded(housing_from_sensor: Array) -> Correction:
    return Correction(
        status="as_recorded",
        calibration_id=None,
        gain=housing_from_sensor,
        bias_g=np.zeros(3),
        u_zero_g_offset_g=np.zeros(3),
        u_scale_factor=np.zeros(3),
        permissible_norm_error_g=RECORDED_NORM_ERROR_G,
        text="as recorded: specific force in g; its calibration is not known here",
    )


def _by_data_sheet(info: DeviceInfo, housing_from_sensor: Array) -> Correction:
    offset_limit_g = info.zero_g_offset_g if info.zero_g_offset_g is not None else UNCALIBRATED_OFFSET_LIMIT_G
    u_offset_g = offset_limit_g / np.sqrt(3)  # a limit is a rectangular distribution (GUM 4.3.7)
    return Correction(
        status="uncalibrated",
        calibration_id=None,
        gain=housing_from_sensor / info.units_per_g,
        bias_g=np.zeros(3),
        u_zero_g_offset_g=np.full(3, u_offset_g),
        u_scale_factor=np.full(3, UNCALIBRATED_SCALE_FACTOR_U),
        u_cross_axis=UNCALIBRATED_CROSS_AXIS_U,
        permissible_norm_error_g=K_UNCALIBRATED * float(np.hypot(u_offset_g, UNCALIBRATED_SCALE_FACTOR_U)),
        text=f"uncalibrated: data sheet sensitivity, zero-g offset unknown within {offset_limit_g * 1000:.0f} mg",
    )
