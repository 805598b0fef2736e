"""From raw readings to specific force in the housing frame, with what is known of its error."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.uncertainty import reading_covariance
from gateway.messages import CalibrationStatus

UNCALIBRATED_SCALE_U = 0.03
"""Relative standard uncertainty of a nominal sensitivity where nothing better is known."""
UNCALIBRATED_CROSS_AXIS_U = 0.01
UNCALIBRATED_OFFSET_G = 0.15
"""Limit of the zero-g offset of a part whose datasheet limit is not known."""
ZERO_G_OFFSET_G_PER_K, SCALE_FACTOR_PER_K = 1e-3, 3e-4
"""Limits of the change with temperature of a part whose datasheet limits are not known."""
RECORDED_NORM_MARGIN_G = 0.01
"""Permissible norm error of a recording in g that brings no calibration record."""


@dataclass(frozen=True, slots=True)
class Correction:
    """An affine correction in force: specific_force_g = raw @ gain.T + bias, in the housing frame."""

    status: CalibrationStatus
    calibration_id: str | None
    gain: NDArray[np.float64]
    bias_g: NDArray[np.float64]
    u_zero_g_offset_g: NDArray[np.float64]
    """Standard uncertainty per housing axis, shape (3,): across the rope that of a reading at rest, how the axes lie included."""
    u_scale_factor: NDArray[np.float64]
    """Relative, per housing axis, shape (3,)."""
    permissible_norm_error_g: float
    """dm of 001 eq. 14."""
    text: str
    record: dict[str, Any] | None = None
    """The calibration record behind it, where there is one."""
    u_cross_axis: float = 0.0
    """Standard uncertainty of what an axis reads of another one, relative."""
    calibrated_c: tuple[float, float] | None = None
    """Lowest and highest temperature of the calibration, beyond which nothing corrects for temperature; None: not known."""
    u_zero_g_offset_g_per_k: float = 0.0
    """What each kelvin beyond that adds to the standard uncertainty of the zero-g offset, on every axis."""
    u_scale_factor_per_k: float = 0.0

    def apply(self, raw: NDArray[np.int32] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Specific force in the housing frame in g, shape (n, 3)."""
        return np.asarray(raw @ self.gain.T + self.bias_g, dtype=np.float64)

    def u_force_g(self, force_g: NDArray[np.float64], temperature_c: float | None = None) -> NDArray[np.float64]:
        """Standard uncertainty per axis of a reading in g, shape (3,), from offset, scale and temperature."""
        then = self.beyond(self.beyond_k(temperature_c))
        return np.asarray(np.hypot(then.u_zero_g_offset_g, then.u_scale_factor * force_g), dtype=np.float64)

    def beyond_k(self, temperature_c: float | None) -> int:
        """How far a temperature lies beyond the calibration's, in whole kelvins, rounded up; 0 where either is not known."""
        if temperature_c is None or self.calibrated_c is None:
            return 0
        low_c, high_c = self.calibrated_c
        return max(0, math.ceil(low_c - temperature_c), math.ceil(temperature_c - high_c))

    def beyond(self, kelvin: float) -> "Correction":
        """The same with the uncertainty that it has so far beyond the calibration's temperatures (type B)."""
        return replace(
            self,
            u_zero_g_offset_g=np.hypot(self.u_zero_g_offset_g, kelvin * self.u_zero_g_offset_g_per_k),
            u_scale_factor=np.hypot(self.u_scale_factor, kelvin * self.u_scale_factor_per_k),
        )

    def range_warnings(self, temperature_c: float | None) -> tuple[str, ...]:
        """That a reading lies beyond the calibration's temperatures, for people; nothing where it does not."""
        if self.calibrated_c is None or not self.beyond_k(temperature_c):
            return ()
        low_c, high_c = self.calibrated_c
        return (f"widened: at {temperature_c:.0f} °C, calibrated at {low_c:.0f} to {high_c:.0f} °C",)


def correction_for(info: DeviceInfo, axes: tuple[tuple[int, int], ...], stored: CalibrationRecord | None) -> Correction:
    """The best that is known of a device: its stored record, its factory record, or the datasheet.

    Raises `CalibrationError` when the record is for another device or another unit of raw input.
    """
    turn = np.zeros((3, 3))
    for housing_axis, (sensor_axis, sign) in enumerate(axes):
        turn[housing_axis, sensor_axis] = sign
    if stored is not None:
        return _from_record("calibrated", stored, info, turn)
    if info.factory_calibration is not None:
        return _from_record("factory", CalibrationRecord.model_validate(info.factory_calibration), info, turn)
    if info.calibrated_source:
        return _as_recorded(turn)
    return _nominal(info, turn)


def _from_record(
    status: CalibrationStatus, record: CalibrationRecord, info: DeviceInfo, turn: NDArray[np.float64]
) -> Correction:
    if record.device_id != info.device_id:
        raise CalibrationError(f"calibration {record.id} belongs to {record.device_id}, not to {info.device_id}")
    if record.unit != info.unit:
        raise CalibrationError(
            f"calibration {record.id} is for raw input in {record.unit}, the device gives {info.unit}"
        )
    gain = turn @ np.array(record.correction_matrix)
    source = np.abs(turn)
    return Correction(
        status=status,
        calibration_id=record.id,
        gain=gain,
        bias_g=-gain @ np.array(record.offset),
        u_zero_g_offset_g=_u_at_rest(record, turn),
        u_scale_factor=source @ record.u_scale_factor,
        permissible_norm_error_g=record.prediction_interval_g,
        text=f"{status}: record {record.id}, {record.method}, {record.created_utc[:10]}",
        record=record.model_dump(mode="json"),
        u_cross_axis=_u_cross_axis(record),
        calibrated_c=_calibrated_c(record),
        u_zero_g_offset_g_per_k=_u_of_limit(info.zero_g_offset_g_per_k, ZERO_G_OFFSET_G_PER_K),
        u_scale_factor_per_k=_u_of_limit(info.scale_factor_per_k, SCALE_FACTOR_PER_K),
    )


def _u_cross_axis(record: CalibrationRecord) -> float:
    """The largest of the six."""
    deviation = np.sqrt(np.diag(np.array(record.covariance))[:9]).reshape(3, 3)
    relative = deviation / np.abs(np.diag(np.array(record.correction_matrix)))[:, None]
    return float((relative * (1 - np.eye(3))).max())


def _calibrated_c(record: CalibrationRecord) -> tuple[float, float] | None:
    known = record.temperature_c
    return None if known is None else (float(known["min"]), float(known["max"]))


def _u_of_limit(limit: float | None, where_unknown: float) -> float:
    """Of a rectangular distribution (GUM 4.3.7)."""
    return (where_unknown if limit is None else limit) / math.sqrt(3)


def _u_at_rest(record: CalibrationRecord, turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Across the rope, of a reading that hangs at rest: zero-g offset, cross-axis sensitivity and attitude with their
    correlations (zeroed in place, their sum is known better than each). Along it, of the zero-g offset alone.
    """
    matrix, covariance = np.array(record.correction_matrix), np.array(record.covariance)
    at_rest = turn @ reading_covariance(matrix, covariance, turn[2]) @ turn.T
    u_g = np.sqrt(np.clip(np.diag(at_rest), 0, None))
    u_g[2] = (np.abs(turn) @ record.u_zero_g_offset_g)[2]
    return u_g


def _as_recorded(turn: NDArray[np.float64]) -> Correction:
    return Correction(
        status="as_recorded",
        calibration_id=None,
        gain=turn,
        bias_g=np.zeros(3),
        u_zero_g_offset_g=np.zeros(3),
        u_scale_factor=np.zeros(3),
        permissible_norm_error_g=RECORDED_NORM_MARGIN_G,
        text="as recorded: specific force in g; its calibration is not known here",
    )


def _nominal(info: DeviceInfo, turn: NDArray[np.float64]) -> Correction:
    offset_limit_g = info.zero_g_offset_g if info.zero_g_offset_g is not None else UNCALIBRATED_OFFSET_G
    u_offset_g = offset_limit_g / np.sqrt(3)  # a limit is a rectangular distribution (GUM 4.3.7)
    return Correction(
        status="uncalibrated",
        calibration_id=None,
        gain=turn / info.units_per_g,
        bias_g=np.zeros(3),
        u_zero_g_offset_g=np.full(3, u_offset_g),
        u_scale_factor=np.full(3, UNCALIBRATED_SCALE_U),
        u_cross_axis=UNCALIBRATED_CROSS_AXIS_U,
        permissible_norm_error_g=2 * float(np.hypot(u_offset_g, UNCALIBRATED_SCALE_U)),
        text=f"uncalibrated: datasheet sensitivity, zero-g offset unknown within {offset_limit_g * 1000:.0f} mg",
    )
