"""Temperature ramps, readings at rest in one attitude while the temperature changes, and the regression of an axis on them.

With the axis up a ramp reads offset + sensitivity, with the axis down offset - sensitivity (Sawicki and Walendziuk 2016, eq. 8
and 10). Both polynomials are fitted to both ramps at once, so the ramps need not have the same temperatures. A square is kept
only where it is significant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.calibration.offline.readings_file import FileReadings
from gateway.calibration.poses.faces import find_face
from gateway.calibration.poses.pose import Face, NominalSensitivity
from gateway.calibration.record import NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array
from gateway.numerics.autocorrelation import correlation_sum
from gateway.numerics.stats import means_by_group, student_quantile

RAMP_AVERAGE_S = 0.5
"""Duration of an average, s; 20 Hz were averaged to 2 Hz (Sawicki and Walendziuk 2016, sec. 3)."""
N_BINS = 40
"""Number of temperature bins of a ramp. Basis: a choice; each averages many readings, and steps of a fortieth show the curve."""
MIN_BIN_C = 0.25
"""Smallest width of a bin, °C. Basis: several steps of a sensor's own thermometer."""
MIN_RAMP_C = 10.0
"""Smallest range of a ramp, °C. Basis: at 0.1 mg/°C the offset changes by 1 mg."""
MIN_RAMP_BINS = 8
"""Least number of bins of a ramp. Basis: a curvature and the scatter show."""
MAX_MOTION_G = 0.025
"""Largest deviation of an average from the curve of its bins, g; beyond it the sensor was moved. Basis: the scatter at which a
pose is not at rest, `windows.STILL_LIMIT_G`."""
QUADRATIC_LEVEL = 0.995
"""One-sided probability of the test of a square. Basis: one straight line in a hundred gets a square by chance."""


@dataclass(frozen=True, slots=True)
class Ramp:
    """The means of a ramp in bins of temperature, b of them, at rising temperatures."""

    path: Path
    face: Face
    temperature_c: Array
    """Mean temperature of each bin, °C, shape (b,)."""
    mean: Array
    """Mean readings, raw, shape (b, 3)."""
    noise: Array
    """Standard deviation of a reading within the averages, raw, shape (3,)."""
    count: int
    """Number of readings."""


def bin_ramp(readings: FileReadings, nominal: NominalSensitivity) -> Ramp:
    """Return the ramp of one recording.

    Raises `InputError` without temperatures, `NotDeterminedError` for a ramp that is too small, moves or lies on no face.
    """
    path = readings.path
    if readings.temperature_c is None or np.isnan(readings.temperature_c).all():
        raise InputError(
            f"{path}: has no temperature; a ramp needs the column temperature_c, or an .mcap whose device reports it"
        )
    known = ~np.isnan(readings.temperature_c)
    time_s, raw, temperature_c = readings.time_s[known], readings.raw[known], readings.temperature_c[known]
    group = np.floor((time_s - time_s[0]) / RAMP_AVERAGE_S)
    averages, scatter = means_by_group(group, np.column_stack([temperature_c, raw]))
    mean_c, means, noise = averages[:, 0], averages[:, 1:], scatter[1:]
    width_c = max(float(np.ptp(mean_c)) / N_BINS, MIN_BIN_C)
    bins, _ = means_by_group(np.floor((mean_c - mean_c.min()) / width_c), averages)
    binned_c, binned = bins[:, 0], bins[:, 1:]
    if np.ptp(binned_c) < MIN_RAMP_C or len(binned) < MIN_RAMP_BINS:
        raise NotDeterminedError(
            f"{path}: the temperature changes by {np.ptp(mean_c):.1f} °C; a ramp needs {MIN_RAMP_C:.0f} °C or more"
        )
    face = find_face(nominal.in_g(binned.mean(axis=0)))
    if face is None:
        raise NotDeterminedError(f"{path}: lies on no face; a ramp needs one axis up or down throughout")
    curve = np.column_stack([np.interp(mean_c, binned_c, axis) for axis in binned.T])
    moved_g = float(np.max(np.abs(means - curve))) / nominal.units_per_g
    if moved_g > MAX_MOTION_G + 6 * float(noise.max()) / nominal.units_per_g:
        raise NotDeterminedError(f"{path}: a reading stands {moved_g * 1000:.0f} mg off its ramp: the sensor was moved")
    return Ramp(path, face, binned_c, binned, noise, len(raw))


@dataclass(frozen=True, slots=True)
class AxisRegression:
    """Polynomials of offset and sensitivity in T - reference, raw units; coefficients by rising power, the constant first."""

    offset: Array
    sensitivity: Array
    covariance: Array
    """Covariance of the coefficients, those of the offset first; it includes the correlation of the residual."""
    freedom: int
    """Degrees of freedom of the residual."""
    residual_rms: float
    """Residual of the bins, raw units."""

    @property
    def coverage_factor(self) -> float:
        """Coverage factor of a two-sided 95 % interval."""
        return student_quantile(0.975, self.freedom)


def fit_axis(axis: int, up: Sequence[Ramp], down: Sequence[Ramp], reference_c: float) -> AxisRegression:
    """Fit both polynomials of an axis (0 to 2), each with a square only where it is significant."""
    full = _fit(axis, up, down, reference_c, (2, 2))
    limit = student_quantile(QUADRATIC_LEVEL, full.freedom)
    u = np.sqrt(np.diag(full.covariance))
    degrees = (
        2 if abs(full.offset[2]) > limit * u[2] else 1,
        2 if abs(full.sensitivity[2]) > limit * u[5] else 1,
    )
    return full if degrees == (2, 2) else _fit(axis, up, down, reference_c, degrees)


def _fit(
    axis: int, up: Sequence[Ramp], down: Sequence[Ramp], reference_c: float, degrees: tuple[int, int]
) -> AxisRegression:
    ramps = [*((ramp, 1.0) for ramp in up), *((ramp, -1.0) for ramp in down)]
    design = np.vstack([_design(ramp.temperature_c - reference_c, sign, degrees) for ramp, sign in ramps])
    reading = np.concatenate([ramp.mean[:, axis] for ramp, _ in ramps])
    scale = np.abs(design).max(axis=0)  # powers of a temperature differ by orders of magnitude
    orthogonal, upper = np.linalg.qr(design / scale)
    inverse = np.linalg.inv(upper)
    coefficients = inverse @ (orthogonal.T @ reading) / scale
    residual = reading - design @ coefficients
    freedom = len(reading) - len(coefficients)
    starts = np.cumsum([len(ramp.mean) for ramp, _ in ramps])[:-1]
    correlation = max(1.0, float(np.mean([correlation_sum(part) for part in np.split(residual, starts)])))
    covariance = inverse @ inverse.T / np.outer(scale, scale) * float(residual @ residual) / freedom * correlation
    n_offset = degrees[0] + 1
    return AxisRegression(
        offset=coefficients[:n_offset],
        sensitivity=coefficients[n_offset:],
        covariance=covariance,
        freedom=max(int(freedom / correlation), 1),
        residual_rms=float(np.sqrt(np.mean(residual**2))),
    )


def _design(from_reference_c: Array, sign: float, degrees: tuple[int, int]) -> Array:
    return np.hstack([_powers(from_reference_c, degrees[0]), sign * _powers(from_reference_c, degrees[1])])


def _powers(value: Array, degree: int) -> Array:
    return np.column_stack([value**power for power in range(degree + 1)])
