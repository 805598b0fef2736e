"""The correction: offset, sensitivity, matrix and misalignment of each sensor axis."""

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import CalibrationRecord
from gateway.documents.format import UNKNOWN, format_fixed, format_with_uncertainty, power_of_ten
from gateway.documents.text import printable_text

Array = NDArray[np.float64]
MAX_EXPONENT = 300
"""Basis: a larger power of ten is no float of 64 bits."""


def correction_rows(record: CalibrationRecord) -> tuple[tuple[str, ...], ...]:
    """Return for each axis its name, offset, sensitivity, three entries of the matrix, misalignment; values with U = 2 u."""
    matrix = np.array(record.correction_matrix, dtype=np.float64)
    return tuple(_row(record, matrix, axis, _exponent(matrix)) for axis in range(3))


def matrix_unit(record: CalibrationRecord) -> str:
    """Return the unit in which the entries of the matrix are printed."""
    exponent = _exponent(np.array(record.correction_matrix, dtype=np.float64))
    return f"{power_of_ten(exponent)} g/{record.unit}" if exponent else f"g/{record.unit}"


def sensitivities(record: CalibrationRecord) -> Array | None:
    """Return the raw units per g of the axes, shape (3,); None where the matrix cannot be inverted."""
    try:
        return np.asarray(np.diag(np.linalg.inv(np.array(record.correction_matrix, dtype=np.float64))))
    except np.linalg.LinAlgError:
        return None


def _row(record: CalibrationRecord, matrix: Array, axis: int, exponent: int) -> tuple[str, ...]:
    u_parameter = np.sqrt(np.clip(np.diag(np.array(record.covariance, dtype=np.float64)), 0, None))
    factor = 10.0**-exponent
    entries = [
        format_with_uncertainty(factor * float(matrix[axis, column]), factor * float(u_parameter[3 * axis + column]))
        for column in range(3)
    ]
    sensitivity = sensitivities(record)
    shown = UNKNOWN
    if sensitivity is not None and matrix[axis, axis] != 0:
        u_relative = float(u_parameter[4 * axis]) / abs(float(matrix[axis, axis]))
        shown = format_with_uncertainty(float(sensitivity[axis]), abs(float(sensitivity[axis])) * u_relative)
    offset = format_with_uncertainty(float(record.offset[axis]), float(u_parameter[9 + axis]))
    return "xyz"[axis], offset, shown, *entries, _misalignment(record, "xyz"[axis])


def _misalignment(record: CalibrationRecord, axis: str) -> str:
    angles = (record.misalignment_deg or {}).get(axis)
    return printable_text("; ".join(format_fixed(angle, 3) for angle in angles[:2]), 40) if angles else UNKNOWN


def _exponent(matrix: Array) -> int:
    """Return the power of ten to factor out, so that the largest entry has a digit before the point."""
    largest = float(np.max(np.abs(matrix)))
    if largest <= 0 or 0.1 <= largest < 1000:
        return 0
    return int(np.clip(np.floor(np.log10(largest)), -MAX_EXPONENT, MAX_EXPONENT))
