"""Regression of one axis on temperature: its zero-g offset and sensitivity from ramps with the axis up and down.

With the axis up a ramp reads offset + sensitivity, with the axis down offset - sensitivity (Sawicki and Walendziuk 2016, eq. 8
and 10). Both polynomials are fitted to both ramps at once, so the ramps need not have the same temperatures. A square is kept
only where it is significant.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gateway.calibration.thermal.ramp import Ramp
from gateway.numerics.array import Array
from gateway.numerics.autocorrelation import correlation_sum
from gateway.numerics.stats import student_quantile

QUADRATIC_LEVEL = 0.995
"""One-sided probability of the test of a square: one straight line in a hundred gets a square by chance."""


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
