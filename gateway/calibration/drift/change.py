"""What changed between two calibrations of one device, with its uncertainty.

With readings raw = S a + b and a record's correction_matrix M = S^-1, the earlier record reads a later sensor as
D a + d, D = M_earlier M_later^-1 and d = M_earlier (b_later - b_earlier): d is the change of the zero-g offsets in g, the
diagonal of D - 1 the relative change of the scale factors, as 000 tables 6 to 8 give them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import CalibrationError, CalibrationRecord

Array = NDArray[np.float64]
DIAGONAL = (0, 4, 8)


@dataclass(frozen=True, slots=True)
class DriftChange:
    """What an earlier record would read, per sensor axis, now that a later one is the truth."""

    offset_g: Array
    """Change of the zero-g offsets, shape (3,)."""
    scale: Array
    """Relative change of the scale factors, shape (3,)."""
    gain: Array
    """D, shape (3, 3)."""
    covariance: Array
    """Of D by rows, then d, shape (12, 12)."""

    @property
    def u_offset_g(self) -> Array:
        """Standard uncertainty of `offset_g`, shape (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[9:]), dtype=np.float64)

    @property
    def u_scale(self) -> Array:
        """Standard uncertainty of `scale`, shape (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[list(DIAGONAL)]), dtype=np.float64)

    @property
    def tilt_error_deg(self) -> Array:
        """Tilt error of each axis read with the earlier record now, from offset and scale (000 eq. 19 and 20), shape (3,)."""
        return np.asarray(np.degrees(tilt_error_rad(reading_error_g(self.offset_g, self.scale))), dtype=np.float64)

    def error_g(self, force_g: Array) -> tuple[Array, Array]:
        """Error of the earlier record at a specific force of shape (3,) in g, and its standard uncertainty, each (3,)."""
        jacobian = np.hstack([np.kron(np.eye(3), force_g), np.eye(3)])
        error_g = (self.gain - np.eye(3)) @ force_g + self.offset_g
        return error_g, np.sqrt(np.diag(jacobian @ self.covariance @ jacobian.T))


def change_between(earlier: CalibrationRecord, later: CalibrationRecord) -> DriftChange:
    """The change, both records' uncertainties included, taken as independent.

    Raises `CalibrationError` where the two are of different devices or units.
    """
    return _change(earlier, later, covariance_of_earlier=np.array(earlier.covariance, dtype=np.float64))


def observable_change(reference: CalibrationRecord, record: CalibrationRecord) -> DriftChange:
    """The change with the uncertainty of `record` alone: points of a series that share one reference.

    Raises `CalibrationError` where the two are of different devices or units.
    """
    return _change(reference, record, covariance_of_earlier=np.zeros((12, 12)))


def reading_error_g(offset_g: Array, scale: Array) -> Array:
    """Largest error of an axis' reading within 1 g, from changes of offset and scale: both in magnitude (000 eq. 19)."""
    return np.asarray(np.abs(offset_g) + np.abs(scale), dtype=np.float64)


def tilt_error_rad(error_g: Array) -> Array:
    """The tilt errors that errors of a reading make (000 eq. 20); a right angle from 1 g on."""
    return np.asarray(np.arcsin(np.minimum(np.abs(error_g), 1.0)), dtype=np.float64)


def _change(earlier: CalibrationRecord, later: CalibrationRecord, covariance_of_earlier: Array) -> DriftChange:
    if earlier.device_id != later.device_id:
        raise CalibrationError(f"records of {earlier.device_id} and {later.device_id}: a drift is that of one device")
    if earlier.unit != later.unit:
        raise CalibrationError(
            f"records {earlier.id} in {earlier.unit} and {later.id} in {later.unit}: a drift needs one unit"
        )
    matrix = np.array(earlier.correction_matrix, dtype=np.float64)
    sensitivity = sensitivity_of(later)
    moved = np.array(later.offset, dtype=np.float64) - np.array(earlier.offset, dtype=np.float64)
    gain = matrix @ sensitivity
    by_earlier, by_later = np.zeros((12, 12)), np.zeros((12, 12))
    by_earlier[:9, :9] = np.kron(np.eye(3), sensitivity.T)
    by_earlier[9:, :9] = np.kron(np.eye(3), moved)
    by_earlier[9:, 9:] = -matrix
    by_later[:9, :9] = -np.kron(gain, sensitivity.T)
    by_later[9:, 9:] = matrix
    covariance = by_earlier @ covariance_of_earlier @ by_earlier.T + by_later @ np.array(later.covariance) @ by_later.T
    return DriftChange(offset_g=matrix @ moved, scale=np.diag(gain) - 1, gain=gain, covariance=covariance)


def sensitivity_of(record: CalibrationRecord) -> Array:
    """Raw units per g, shape (3, 3). Raises `CalibrationError` where the matrix cannot be inverted."""
    try:
        return np.linalg.inv(np.array(record.correction_matrix, dtype=np.float64))
    except np.linalg.LinAlgError as error:
        raise CalibrationError(f"record {record.id}: correction_matrix is singular; calibrate again") from error
