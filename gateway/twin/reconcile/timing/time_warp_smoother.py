"""Least squares with a time warp: the warp is eliminated from the normal equations and recovered afterwards.

True time is a linear function of recorded time plus a random walk with independent steps between knots. With the variance of the
steps as prior, the normal matrix of the walk is tridiagonal, so its elimination costs little. This is a Kalman smoother in the
form of one linear system.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]
KNOT_SPACING_SAMPLES = 5
"""Samples between knots: a quarter of a second at 20 Hz, in which a swing hardly moves."""
RANK_TOLERANCE = 1e-10
"""Singular value of the scaled normal matrix, relative to the largest, below which values are linearly dependent."""
MIN_SCALE = 1e-12
"""Added to the scale of each value, so that one without any sensitivity gives no division by zero."""


@dataclass(frozen=True, slots=True)
class Knots:
    """The samples at which the warp is known; between them it is interpolated linearly."""

    before: NDArray[np.int64]
    """Knot at or before each sample, shape (n,)."""
    share: Array
    """Share of the way from that knot to the next, shape (n,)."""
    count: int

    def at_samples(self, warp: Array) -> Array:
        """Return a warp (count,) at the samples, shape (n,)."""
        interpolated: Array = warp[self.before] * (1 - self.share) + warp[self.before + 1] * self.share
        return interpolated

    def gathered(self, values: Array) -> Array:
        """Return the sums at the knots of values (n, k) at samples, each shared by two knots, shape (count, k)."""
        sums = np.zeros((self.count, values.shape[1]))
        np.add.at(sums, self.before, (1 - self.share)[:, None] * values)
        np.add.at(sums, self.before + 1, self.share[:, None] * values)
        return sums


def make_knots(samples: int) -> Knots:
    """Return knots for so many samples, the first at the first of them, the last at the last or beyond."""
    rows = np.arange(samples)
    return Knots(
        rows // KNOT_SPACING_SAMPLES,
        (rows % KNOT_SPACING_SAMPLES) / KNOT_SPACING_SAMPLES,
        len(range(0, samples + KNOT_SPACING_SAMPLES, KNOT_SPACING_SAMPLES)),
    )


@dataclass(frozen=True, slots=True)
class TimeWarpSmoother:
    """Normal equations of k values after the warp is eliminated."""

    normal: Array
    """Shape (k, k)."""
    gradient: Array
    """Shape (k,)."""
    warp_by_values: Array
    """Change of the warp per step of -1 in each value; last the warp where no value moves, shape (count, k + 1)."""

    def solve(self, chosen: Sequence[int]) -> tuple[Array, float]:
        """Return the step of the chosen values, the others held, and the decrease of chi-square."""
        normal, gradient = self.normal[np.ix_(chosen, chosen)], self.gradient[list(chosen)]
        scale = np.sqrt(np.maximum(np.diag(normal), 0.0)) + MIN_SCALE
        scaled = np.linalg.lstsq(normal / np.outer(scale, scale), gradient / scale, rcond=RANK_TOLERANCE)[0]
        step: Array = scaled / scale
        return step, float(step @ gradient)

    def warp(self, chosen: Sequence[int], step: Array) -> Array:
        """Return the warp that goes with a step of the chosen values, shape (count,)."""
        warp: Array = self.warp_by_values[:, -1] - self.warp_by_values[:, list(chosen)] @ step
        return warp


def marginalise_time_warp(
    residual: Array, by_time: Array, by_values: Array, warp: Array, knots: Knots, step_variance: float
) -> TimeWarpSmoother:
    """Return the normal equations for residuals (n, 3) in sigma that were computed with a warp (count,).

    `by_time` (n, 3) and `by_values` (n, 3, k) are the derivatives of the simulation; `step_variance` is that between knots.
    """
    without_warp = residual + by_time * knots.at_samples(warp)[:, None]
    columns = np.concatenate([by_values, without_warp[:, :, None]], axis=2)
    by_knots = knots.gathered(np.einsum("ni,nik->nk", by_time, columns))
    warp_by_values = _solve_warp(by_time, knots, step_variance, by_knots)
    flat = columns.reshape(-1, columns.shape[2])
    normal = flat.T @ flat - by_knots.T @ warp_by_values
    return TimeWarpSmoother(normal[:-1, :-1], normal[:-1, -1], warp_by_values)


def effective_degrees_of_freedom(by_time: Array, knots: Knots, step_variance: float) -> float:
    """Return the number of steps of the warp that the samples determine, and not the prior (MacKay 1992)."""
    steps = np.diff(np.eye(knots.count), axis=0)
    from_prior = _solve_warp(by_time, knots, step_variance, steps.T @ steps / step_variance)
    return knots.count - 1 - float(np.trace(from_prior[1:, 1:]))


def _solve_warp(by_time: Array, knots: Knots, step_variance: float, right: Array) -> Array:
    """Return the solution of the warp's normal equations, shape (count, k); the warp is zero at the first knot."""
    square = (by_time**2).sum(axis=1)
    diagonal = np.full(knots.count, 2 / step_variance)
    diagonal[-1] = 1 / step_variance
    np.add.at(diagonal, knots.before, square * (1 - knots.share) ** 2)
    np.add.at(diagonal, knots.before + 1, square * knots.share**2)
    above = np.full(knots.count, -1 / step_variance)
    np.add.at(above, knots.before + 1, square * knots.share * (1 - knots.share))
    solution = np.zeros_like(right)
    solution[1:] = solveh_banded(np.stack([above, diagonal])[:, 1:], right[1:])
    return solution
