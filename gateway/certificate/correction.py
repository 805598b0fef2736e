"""The correction itself: offset, sensitivity, matrix and misalignment per sensor axis."""

from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.element import Content, element, short, table
from gateway.certificate.figures import UNKNOWN, with_u

Array = NDArray[np.float64]
LARGEST_EXPONENT = 300
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def correction(record: CalibrationRecord) -> Element:
    """One row per axis; all with U = 2 u."""
    matrix = np.array(record.correction_matrix, dtype=np.float64)
    exponent = _exponent(matrix)
    power = f"10{str(exponent).translate(SUPERSCRIPT)} " if exponent else ""
    unit = record.unit
    rows = [_row(record, matrix, axis, exponent) for axis in range(3)]
    columns = [f"matrix {axis}" for axis in "xyz"]
    return element(
        "section",
        element("h2", "Correction"),
        element(
            "p",
            "corrected = matrix · (raw − offset), in the sensor's axes. ± is the expanded uncertainty, k = 2. "
            f"The matrix in {power}g/{unit}.",
        ),
        table(["axis", f"offset / {unit}", f"sensitivity / ({unit}/g)", *columns, "misalignment / °"], rows, "numbers"),
    )


def sensitivities(record: CalibrationRecord) -> Array | None:
    """Raw units per g of the axes, shape (3,); None where the matrix cannot be inverted."""
    try:
        return np.asarray(np.diag(np.linalg.inv(np.array(record.correction_matrix, dtype=np.float64))))
    except np.linalg.LinAlgError:
        return None


def _row(record: CalibrationRecord, matrix: Array, axis: int, exponent: int) -> list[Content]:
    u_parameter = np.sqrt(np.clip(np.diag(np.array(record.covariance, dtype=np.float64)), 0, None))
    factor = 10.0**-exponent
    entries: list[Content] = [
        with_u(factor * float(matrix[axis, column]), factor * float(u_parameter[3 * axis + column]))
        for column in range(3)
    ]
    sensitivity = sensitivities(record)
    said = UNKNOWN
    if sensitivity is not None and matrix[axis, axis] != 0:
        u_relative = float(u_parameter[4 * axis]) / abs(float(matrix[axis, axis]))
        said = with_u(float(sensitivity[axis]), abs(float(sensitivity[axis])) * u_relative)
    offset = with_u(float(record.offset[axis]), float(u_parameter[9 + axis]))
    return ["xyz"[axis], offset, said, *entries, _misalignment(record, "xyz"[axis])]


def _misalignment(record: CalibrationRecord, axis: str) -> str:
    angles = (record.misalignment_deg or {}).get(axis)
    return short("; ".join(f"{angle:.3f}" for angle in angles[:2]), 40) if angles else UNKNOWN


def _exponent(matrix: Array) -> int:
    """Power of ten to put before the matrix, so that its largest entry has a digit before the point."""
    largest = float(np.max(np.abs(matrix)))
    if largest <= 0 or 0.1 <= largest < 1000:
        return 0
    return int(np.clip(np.floor(np.log10(largest)), -LARGEST_EXPONENT, LARGEST_EXPONENT))
