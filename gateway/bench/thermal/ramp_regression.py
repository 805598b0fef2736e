"""Regression of the three axes on their temperature ramps.

With the axis up a ramp reads offset + sensitivity, with the axis down offset - sensitivity (Sawicki and Walendziuk 2016, eq. 8
and 10), across it the offset and the little that the axis leans: offset + force sensitivity, with the force that the ramp itself
shows. All ramps are fitted at once, each with its own constant, so they need not have the same temperatures. A square is kept
only where it is significant.

The lag between thermometer and element is a parameter common to all axes and ramps; a hysteresis has a size of its own in each
axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import numpy as np

from gateway.bench.thermal.hysteresis import NUMBERS, PRIOR_PLAY_G, Explanation, explain, mean_over, play_forms
from gateway.bench.thermal.ramp import Ramp, element_c
from gateway.bench.thermal.slow_noise import NoiseGrid, RecordingCoefficients, System, block_means
from gateway.calibration.pose import FACES
from gateway.numerics.array import Array
from gateway.numerics.stats import student_quantile

PLACES_PER_BLOCK = 8
"""Temperatures of a block by which a hysteresis is followed. Basis: a choice; a turn in a block is seen to an eighth of it."""
N_BLOCKS = 48
"""Number of blocks of a ramp. Basis: a choice; the shape of a ramp shows, and noise down to a fortieth of its duration."""
FULL = ((2, 2),) * 3
"""Definition: degrees of offset and sensitivity of the three axes with all squares."""
QUADRATIC_LEVEL = 0.995
"""One-sided probability of the test of a square. Basis: one straight line in a hundred gets a square by chance."""
Cause = Literal["noise", "drift in time", "lag of the thermometer", "hysteresis"]
CAUSES: tuple[Cause, ...] = get_args(Cause)


@dataclass(frozen=True, slots=True)
class AxisRegression:
    """Polynomials of offset and sensitivity in T - reference, raw units; coefficients by rising power, the constant first."""

    offset: Array
    sensitivity: Array
    causes: Array
    """Covariance of the coefficients, those of the offset first, by each of `CAUSES`, shape (4, p, p)."""
    rows: Array
    """The coefficients as combinations of those of the fit."""
    fit: RecordingCoefficients

    @property
    def covariance(self) -> Array:
        """Covariance of the coefficients, shape (p, p)."""
        return np.asarray(self.causes.sum(axis=0))

    def dominant(self, row: Array) -> Cause:
        """Return what contributes most to the uncertainty of row . coefficients."""
        return CAUSES[int(np.argmax(row @ self.causes @ row))]

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


def fit_ramps(ramps: Sequence[Ramp], reference_c: float) -> RampRegression:
    """Fit offset and sensitivity of all axes to ramps on all six faces."""
    model = _RampModel(ramps, reference_c)
    full = explain(model.grid, lambda lag_s, play: model.systems(lag_s, play, FULL), dict.fromkeys(NUMBERS, 0.0))
    degrees = [_needed(model.fit(axis, FULL, full[0], full[0].lag_s)) for axis in range(3)]
    found = explain(
        model.grid, lambda lag_s, play: model.systems(lag_s, play, degrees), {one.play: one.lag_s for one in full}
    )
    lag_s = sum(one.probability * one.lag_s for one in found)
    return RampRegression(tuple(model.axis_regression(axis, degrees, found) for axis in range(3)), lag_s)


def _needed(full: RecordingCoefficients) -> tuple[int, int]:
    """Return the degrees of offset and sensitivity; the last four coefficients are T and T² of both."""
    u = np.sqrt(np.diag(full.covariance))
    row = np.eye(len(u))

    def degree(place: int) -> int:
        limit = student_quantile(QUADRATIC_LEVEL, max(full.freedom_of(row[place]), 1.0))
        return 2 if abs(full.values[place]) > limit * u[place] else 1

    return degree(-3), degree(-1)


@cache
def _noise_grid(blocks: int) -> NoiseGrid:
    return NoiseGrid((np.arange(blocks) + 0.5) / blocks - 0.5)


class _RampModel:
    """The ramps in blocks, and the designs of the axes for a lag and a hysteresis."""

    def __init__(self, ramps: Sequence[Ramp], reference_c: float) -> None:
        blocks = min(N_BLOCKS, *(len(ramp.mean) for ramp in ramps))
        self.grid = _noise_grid(blocks)
        self._blocks = blocks
        self._ramps, self._reference_c = ramps, reference_c
        self._reading = np.array([block_means(ramp.mean, blocks) for ramp in ramps])
        faces = np.array([FACES.index(ramp.face) for ramp in ramps])
        self._weight = np.array([(faces == face) / np.sum(faces == face) for face in range(6)])
        at_reference = np.array([ramp.pose_at(reference_c, 0.0).mean for ramp in ramps])
        up, down = self._weight[::2] @ at_reference, self._weight[1::2] @ at_reference
        self._force = (at_reference - np.diag(up + down) / 2) / (np.diag(up - down) / 2)
        self._scale_c = max(float(np.ptp(ramp.temperature_c)) for ramp in ramps)
        places = blocks * min(PLACES_PER_BLOCK, min(len(ramp.mean) for ramp in ramps) // blocks)
        temperature_c = np.array([block_means(ramp.temperature_c[:, None], places)[:, 0] for ramp in ramps])
        width_g = PRIOR_PLAY_G * float(np.abs(np.diag(up - down)).mean()) / 2
        forms = play_forms(temperature_c)
        in_blocks = forms.reshape(len(forms), len(ramps), blocks, -1, 2).mean(axis=3)
        in_blocks -= in_blocks.mean(axis=(1, 2), keepdims=True)  # the offset is that of the mean side in the ramps
        self._known_powers: dict[float, Array] = {}
        self._variance = [0.0] * 3
        self._plays = [np.zeros((len(ramps), blocks, 0)), *(width_g * in_blocks)]
        straight = self.systems(0.0, 0, FULL)
        white, _ = self.grid.estimate(straight)
        self._variance = [white.solve(*system).sigma ** 2 for system in straight]

    def systems(self, lag_s: float, number: int, degrees: Sequence[tuple[int, int]]) -> list[System]:
        """Return the system of each axis for a play."""
        of_offset = self._powers(lag_s)
        return [
            (
                np.concatenate(
                    [
                        self._plays[number],
                        of_offset[..., :offset],
                        self._force[:, axis, None, None] * of_offset[..., :sensitivity],
                    ],
                    axis=2,
                ),
                self._reading[..., axis],
                np.append(np.full(self._plays[number].shape[2], self._variance[axis]), np.zeros(offset + sensitivity)),
            )
            for axis, (offset, sensitivity) in enumerate(degrees)
        ]

    def _powers(self, lag_s: float) -> Array:
        """Return the change of the temperature of the element and its square, over `scale_c`, (ramps, blocks, 2)."""
        if lag_s not in self._known_powers:
            powers = []
            for ramp in self._ramps:
                change = (element_c(ramp.time_s, ramp.temperature_c, lag_s) - self._reference_c) / self._scale_c
                powers.append(block_means(np.column_stack([change, change**2]), self._blocks))
            self._known_powers[lag_s] = np.array(powers)
        return self._known_powers[lag_s]

    def fit(
        self, axis: int, degrees: Sequence[tuple[int, int]], one: Explanation, lag_s: float
    ) -> RecordingCoefficients:
        """Return the fit of an axis by a hypothesis at a lag."""
        return one.noise.solve(*self.systems(lag_s, one.play, degrees)[axis])

    def axis_regression(
        self, axis: int, degrees: Sequence[tuple[int, int]], explanations: Sequence[Explanation]
    ) -> AxisRegression:
        """Return the polynomials of an axis: the mean over the hypotheses, and their spread in the covariance."""
        each, inside, rows, fits = zip(*(self._polynomials(axis, degrees, one) for one in explanations), strict=True)
        values, causes = mean_over(explanations, each, inside)
        n_offset = degrees[axis][0] + 1
        return AxisRegression(values[:n_offset], values[n_offset:], causes, rows[0], fits[0])

    def _polynomials(
        self, axis: int, degrees: Sequence[tuple[int, int]], one: Explanation
    ) -> tuple[Array, Array, Array, RecordingCoefficients]:
        """Return coefficients, their covariances by noise, drift and lag, their rows in those of the fit, and the fit."""
        fit, ahead = (self.fit(axis, degrees, one, lag_s) for lag_s in (one.lag_s, one.lag_s + one.u_lag_s))
        n_offset, n_scale = degrees[axis]
        up, down = self._weight[2 * axis], self._weight[2 * axis + 1]
        count, scale = len(self._ramps), [self._scale_c ** -(power + 1) for power in range(2)]
        first = count + self._plays[one.play].shape[2]
        rows = np.zeros((2 + n_offset + n_scale, len(fit.values)))
        rows[0, :count], rows[n_offset + 1, :count] = (up + down) / 2, (up - down) / 2
        rows[1 : n_offset + 1, first : first + n_offset] = np.diag(scale[:n_offset])
        rows[n_offset + 2 :, first + n_offset :] = np.diag(scale[:n_scale])
        by_lag = rows @ (fit.values - ahead.values)
        by_drift = rows @ fit.drift_root @ fit.drift_root.T @ rows.T
        causes = [rows @ fit.covariance @ rows.T - by_drift, by_drift, np.outer(by_lag, by_lag)]
        return rows @ fit.values, np.array(causes), rows, fit
