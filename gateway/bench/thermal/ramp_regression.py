"""Regression of the three axes on their temperature ramps.

With the axis up a ramp reads offset + sensitivity, with the axis down offset - sensitivity (Sawicki and Walendziuk 2016, eq. 8
and 10), across it the offset and the little that the axis leans: offset + force sensitivity, with the force that the ramp itself
shows. All ramps are fitted at once, each with its own constant, so they need not have the same temperatures. A square is kept
only where it is significant.

The lag between thermometer and element is a parameter common to all axes and ramps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from gateway.bench.thermal.ramp import Ramp, element_c, fit_lag
from gateway.bench.thermal.slow_noise import (
    NoiseRatios,
    RecordingCoefficients,
    RecordingNoise,
    block_means,
    estimate_noise,
)
from gateway.calibration.poses.faces import FACES
from gateway.numerics.array import Array
from gateway.numerics.stats import student_quantile

N_BLOCKS = 48
"""Number of blocks of a ramp. Basis: a choice; the shape of a ramp shows, and noise down to a fortieth of its duration."""
QUADRATIC_LEVEL = 0.995
"""One-sided probability of the test of a square. Basis: one straight line in a hundred gets a square by chance."""


@dataclass(frozen=True, slots=True)
class AxisRegression:
    """Polynomials of offset and sensitivity in T - reference, raw units; coefficients by rising power, the constant first."""

    offset: Array
    sensitivity: Array
    covariance: Array
    """Covariance of the coefficients, those of the offset first; it includes the lag."""
    rows: Array
    """The coefficients as combinations of those of the fit."""
    fit: RecordingCoefficients

    @property
    def drift_g(self) -> float:
        """Standard deviation of the drift over a ramp, g."""
        return abs(self.fit.drift / float(self.sensitivity[0]))

    def coverage_factor(self, row: Array) -> float:
        """Return the factor of a two-sided 95 % interval of row . coefficients."""
        return self.fit.coverage_factor(row @ self.rows)


@dataclass(frozen=True, slots=True)
class RampRegression:
    """Regression of the three axes."""

    axes: tuple[AxisRegression, ...]
    lag_s: float
    """Lag of the thermometer behind the element; negative: of the element behind the thermometer."""
    u_lag_s: float


def fit_ramps(ramps: Sequence[Ramp], reference_c: float) -> RampRegression:
    """Fit offset and sensitivity of all axes to ramps on all six faces."""
    model = _RampModel(ramps, reference_c)
    degrees, noise, lag_s = [(2, 2)] * 3, RecordingNoise(model.place, NoiseRatios()), 0.0
    for step in range(3):
        lag_s, u_lag_s = fit_lag(partial(model.fits, degrees=degrees, noise=noise), lag_s)
        noise = estimate_noise(model.place, model.systems(lag_s, degrees))
        if step == 1:
            degrees = [_needed(fit) for fit in model.fits(lag_s, degrees, noise)]
    found, ahead = model.fits(lag_s, degrees, noise), model.fits(lag_s + u_lag_s, degrees, noise)
    axes = tuple(
        model.axis_regression(axis, fit, fit.values - other.values, degrees[axis])
        for axis, (fit, other) in enumerate(zip(found, ahead, strict=True))
    )
    return RampRegression(axes, lag_s, u_lag_s)


def _needed(full: RecordingCoefficients) -> tuple[int, int]:
    """Return the degrees of offset and sensitivity; the last four coefficients are T and T² of both."""
    u = np.sqrt(np.diag(full.covariance))
    limit = student_quantile(QUADRATIC_LEVEL, full.freedom)
    offset, sensitivity = (2 if abs(full.values[place]) > limit * u[place] else 1 for place in (-3, -1))
    return offset, sensitivity


class _RampModel:
    """The ramps in blocks, and the designs of the axes for a lag."""

    def __init__(self, ramps: Sequence[Ramp], reference_c: float) -> None:
        blocks = min(N_BLOCKS, *(len(ramp.mean) for ramp in ramps))
        self.place = (np.arange(blocks) + 0.5) / blocks - 0.5
        self._ramps, self._reference_c = ramps, reference_c
        self._reading = np.array([block_means(ramp.mean, blocks) for ramp in ramps])
        faces = np.array([FACES.index(ramp.face) for ramp in ramps])
        self._weight = np.array([(faces == face) / np.sum(faces == face) for face in range(6)])
        at_reference = np.array([ramp.pose_at(reference_c, 0.0).mean for ramp in ramps])
        up, down = self._weight[::2] @ at_reference, self._weight[1::2] @ at_reference
        self._force = (at_reference - np.diag(up + down) / 2) / (np.diag(up - down) / 2)
        self._scale_c = max(float(np.ptp(ramp.temperature_c)) for ramp in ramps)

    def systems(self, lag_s: float, degrees: Sequence[tuple[int, int]]) -> list[tuple[Array, Array]]:
        """Return design, (ramps, blocks, p), and readings, (ramps, blocks), of each axis."""
        blocks = len(self.place)
        powers = []
        for ramp in self._ramps:
            change = (element_c(ramp.time_s, ramp.temperature_c, lag_s) - self._reference_c) / self._scale_c
            powers.append(block_means(np.column_stack([change, change**2]), blocks))
        of_offset = np.array(powers)
        return [
            (
                np.concatenate(
                    [of_offset[..., :offset], self._force[:, axis, None, None] * of_offset[..., :sensitivity]], axis=2
                ),
                self._reading[..., axis],
            )
            for axis, (offset, sensitivity) in enumerate(degrees)
        ]

    def fits(
        self, lag_s: float, degrees: Sequence[tuple[int, int]], noise: RecordingNoise
    ) -> list[RecordingCoefficients]:
        """Return the fit of each axis at a lag."""
        return [noise.solve(*system, axes=3) for system in self.systems(lag_s, degrees)]

    def axis_regression(
        self, axis: int, fit: RecordingCoefficients, by_lag: Array, degrees: tuple[int, int]
    ) -> AxisRegression:
        """Return the polynomials of an axis; `by_lag` is the change of the fit by the uncertainty of the lag."""
        up, down = self._weight[2 * axis], self._weight[2 * axis + 1]
        count, scale = len(self._ramps), [self._scale_c ** -(power + 1) for power in range(2)]
        n_offset = degrees[0]
        rows = np.zeros((2 + sum(degrees), len(fit.values)))
        rows[0, :count], rows[n_offset + 1, :count] = (up + down) / 2, (up - down) / 2
        rows[1 : n_offset + 1, count : count + n_offset] = np.diag(scale[:n_offset])
        rows[n_offset + 2 :, count + n_offset :] = np.diag(scale[: degrees[1]])
        values, change = rows @ fit.values, rows @ by_lag
        return AxisRegression(
            offset=values[: n_offset + 1],
            sensitivity=values[n_offset + 1 :],
            covariance=rows @ fit.covariance @ rows.T + np.outer(change, change),
            rows=rows,
            fit=fit,
        )
