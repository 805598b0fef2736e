"""Change of a sensor between two calibrations, with its uncertainty.

With readings raw = S a + b and the correction matrix M = S^-1, the earlier record reads a specific force of the later sensor as
D a + d, where D = M_earlier S_later and d = M_earlier (b_later - b_earlier). d is the change of the zero-g offsets in g, the
diagonal of D - 1 the relative change of the scale factors, as in Łuczak et al. 2022, Tables 6 to 8. A thermal model of the
earlier record is evaluated at the temperature of the later one, so that thermal drift does not count as ageing.
"""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.thermal_model import correction_at, holds_at_c
from gateway.numerics.array import Array

DIAGONAL = (0, 4, 8)
"""Places of the diagonal among the nine entries of a matrix by rows. Definition: of a 3 x 3 matrix."""
ROTATION_OF_GAIN = (
    np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]]) / 2
)
"""Small rotation about x, y and z, by the nine entries of a matrix: its antisymmetric part."""


@dataclass(frozen=True, slots=True)
class SensorChange:
    """Change of a sensor between two calibrations, in the sensor's axes."""

    gain: Array
    """D, shape (3, 3)."""
    offset_g: Array
    """Change of the zero-g offsets, g, shape (3,)."""

    @property
    def scale(self) -> Array:
        """Relative change of the scale factors, shape (3,)."""
        return np.asarray(np.diag(self.gain) - 1, dtype=np.float64)

    @property
    def rotation_deg(self) -> Array:
        """Rotation of the axes about x, y and z, degrees, shape (3,)."""
        return np.asarray(np.degrees(ROTATION_OF_GAIN @ self.gain.ravel()), dtype=np.float64)

    @property
    def tilt_error_deg(self) -> Array:
        """Tilt error of each axis with the earlier record (Łuczak et al. 2022, eq. 19 and 20), degrees, shape (3,)."""
        return np.asarray(np.degrees(tilt_error_rad(reading_error_g(self.offset_g, self.scale))), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class DriftChange(SensorChange):
    """Change of a sensor between two records, with its uncertainty."""

    covariance: Array
    """Covariance of D by rows, then d, shape (12, 12)."""

    @property
    def u_offset_g(self) -> Array:
        """Standard uncertainty of `offset_g`, shape (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[9:]), dtype=np.float64)

    @property
    def u_scale(self) -> Array:
        """Standard uncertainty of `scale`, shape (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[list(DIAGONAL)]), dtype=np.float64)

    @property
    def u_rotation_deg(self) -> Array:
        """Standard uncertainty of `rotation_deg`, shape (3,)."""
        variance = np.diag(ROTATION_OF_GAIN @ self.covariance[:9, :9] @ ROTATION_OF_GAIN.T)
        return np.asarray(np.degrees(np.sqrt(np.clip(variance, 0, None))), dtype=np.float64)

    def error_g(self, force_g: Array) -> tuple[Array, Array]:
        """Return the error of the earlier record at a specific force in g, and its standard uncertainty, each of shape (3,)."""
        jacobian = np.hstack([np.kron(np.eye(3), force_g), np.eye(3)])
        error_g = (self.gain - np.eye(3)) @ force_g + self.offset_g
        return error_g, np.sqrt(np.diag(jacobian @ self.covariance @ jacobian.T))


def sensor_change(*, matrix: Array, offset: Array, later_sensitivity: Array, later_offset: Array) -> SensorChange:
    """Return the change from an earlier correction to a later sensitivity, raw units per g, and offset."""
    return SensorChange(gain=matrix @ later_sensitivity, offset_g=matrix @ (later_offset - offset))


def change_between(earlier: CalibrationRecord, later: CalibrationRecord, *, is_reference: bool = False) -> DriftChange:
    """Return the change with the uncertainties of both records, which are taken as independent.

    `is_reference`: the earlier one is that of a series of records, and its uncertainty, common to all of them, does not count.
    Raises `CalibrationError` if the records are of different devices or units.
    """
    if earlier.device_id != later.device_id:
        raise CalibrationError(f"records of {earlier.device_id} and {later.device_id}: a drift is that of one device")
    if earlier.unit != later.unit:
        raise CalibrationError(
            f"records {earlier.id} in {earlier.unit} and {later.id} in {later.unit}: a drift needs one unit"
        )
    matrix, offset = correction_at(earlier, holds_at_c(later.temperature_c, later.thermal))
    later_offset = np.array(later.offset, dtype=np.float64)
    sensitivity = sensitivity_of(later)
    change = sensor_change(matrix=matrix, offset=offset, later_sensitivity=sensitivity, later_offset=later_offset)
    earlier_jacobian, later_jacobian = np.zeros((12, 12)), np.zeros((12, 12))
    earlier_jacobian[:9, :9] = np.kron(np.eye(3), sensitivity.T)
    earlier_jacobian[9:, :9] = np.kron(np.eye(3), later_offset - offset)
    earlier_jacobian[9:, 9:] = -matrix
    later_jacobian[:9, :9] = -np.kron(change.gain, sensitivity.T)
    later_jacobian[9:, 9:] = matrix
    covariance = later_jacobian @ np.array(later.covariance) @ later_jacobian.T
    if not is_reference:
        covariance = earlier_jacobian @ np.array(earlier.covariance) @ earlier_jacobian.T + covariance
    return DriftChange(gain=change.gain, offset_g=change.offset_g, covariance=covariance)


def reading_error_g(offset_g: Array, scale: Array) -> Array:
    """Return the largest error of a reading within 1 g from the changes of offset and scale (Łuczak et al. 2022, eq. 19), g.

    The source adds both with their signs. They are independent of each other, so here the magnitudes add.
    """
    return np.asarray(np.abs(offset_g) + np.abs(scale), dtype=np.float64)


def tilt_error_rad(error_g: Array) -> Array:
    """Return the tilt errors that errors of a reading cause (Łuczak et al. 2022, eq. 20), radians; a right angle from 1 g."""
    return np.asarray(np.arcsin(np.minimum(np.abs(error_g), 1.0)), dtype=np.float64)


def sensitivity_of(record: CalibrationRecord) -> Array:
    """Return the sensitivity, raw units per g, shape (3, 3). Raises `CalibrationError` if the matrix cannot be inverted."""
    try:
        return np.linalg.inv(np.array(record.correction_matrix, dtype=np.float64))
    except np.linalg.LinAlgError as error:
        raise CalibrationError(f"record {record.id}: correction_matrix is singular; calibrate again") from error
