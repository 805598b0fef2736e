"""Least squares beside time that wanders: the walk is solved for given the rest, put in, and given back afterwards.

True time by recorded time is a line plus a random walk with independent steps between knots. With the steps' own spread as prior
the walk's normal matrix has three diagonals, so that it costs little to be rid of it (a Kalman smoother as one linear system).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KNOT_SPACING_SAMPLES = 5
"""Samples from knot to knot of the walk."""
ANCHOR_WEIGHT = 1e12
"""Weight that holds the walk at 0 where it begins."""
RCOND = 1e-10


@dataclass(frozen=True, slots=True)
class Knots:
    """Where the walk is known, and how n samples lie between."""

    left: NDArray[np.int64]
    """The knot before each sample, shape (n,)."""
    share: Array
    """Of the way to the next, shape (n,)."""
    count: int

    def at_samples(self, walk: Array) -> Array:
        """Shape (n,), of a walk (count,)."""
        found: Array = walk[self.left] * (1 - self.share) + walk[self.left + 1] * self.share
        return found

    def gathered(self, values: Array) -> Array:
        """Sums at the knots of (n, k) at samples, each touching two, shape (count, k)."""
        found = np.zeros((self.count, values.shape[1]))
        np.add.at(found, self.left, (1 - self.share)[:, None] * values)
        np.add.at(found, self.left + 1, self.share[:, None] * values)
        return found


def make_knots(samples: int) -> Knots:
    """The first at the first sample, the last at the last or beyond."""
    rows = np.arange(samples)
    return Knots(
        rows // KNOT_SPACING_SAMPLES,
        (rows % KNOT_SPACING_SAMPLES) / KNOT_SPACING_SAMPLES,
        len(range(0, samples + KNOT_SPACING_SAMPLES, KNOT_SPACING_SAMPLES)),
    )


@dataclass(frozen=True, slots=True)
class TimeWarpSmoother:
    """Normal equations of k values with the walk put in."""

    normal: Array
    """Shape (k, k)."""
    gradient: Array
    """Shape (k,)."""
    by_walk: Array
    """The walk for each value that moves by -1, and last for none, shape (count, k + 1)."""

    def solve(self, chosen: Sequence[int]) -> tuple[Array, float]:
        """Step of the chosen values, the others at rest, and by how much chi-square falls."""
        matrix, pull = self.normal[np.ix_(chosen, chosen)], self.gradient[list(chosen)]
        scale = np.sqrt(np.maximum(np.diag(matrix), 0.0)) + 1e-12
        step: Array = np.linalg.lstsq(matrix / np.outer(scale, scale), pull / scale, rcond=RCOND)[0] / scale
        return step, float(step @ pull)

    def walk(self, chosen: Sequence[int], step: Array) -> Array:
        """That goes with a step, shape (count,)."""
        found: Array = self.by_walk[:, -1] - self.by_walk[:, list(chosen)] @ step
        return found


def marginalise_time_warp(
    residual: Array, by_time: Array, by_values: Array, walk: Array, knots: Knots, spread: float
) -> TimeWarpSmoother:
    """From residuals (n, 3) in sigma at a walk (count,), how they answer to time (n, 3) and to k values (n, 3, k).

    `spread` is the variance of a step from knot to knot.
    """
    at_rest = residual + by_time * knots.at_samples(walk)[:, None]
    columns = np.concatenate([by_values, at_rest[:, :, None]], axis=2)
    by_knots = knots.gathered(np.einsum("ni,nik->nk", by_time, columns))
    by_walk = _solve_tridiagonal(*_tridiagonal_normal_matrix(by_time, knots, spread), by_knots)
    flat = columns.reshape(-1, columns.shape[2])
    whole = flat.T @ flat - by_knots.T @ by_walk
    return TimeWarpSmoother(whole[:-1, :-1], whole[:-1, -1], by_walk)


def effective_degrees_of_freedom(by_time: Array, knots: Knots, spread: float) -> float:
    """Number of the walk's steps that the readings tell: the trace of what they add to the prior (MacKay 1992)."""
    steps = np.diff(np.eye(knots.count), axis=0)
    known = _solve_tridiagonal(*_tridiagonal_normal_matrix(by_time, knots, spread), steps.T @ steps / spread)
    return knots.count - 1 - float(np.trace(known[1:, 1:]))


def _tridiagonal_normal_matrix(by_time: Array, knots: Knots, spread: float) -> tuple[Array, Array]:
    """Of the walk's normal matrix: the main one and the one beside it, shapes (count,) and (count - 1,)."""
    square = (by_time**2).sum(axis=1)
    main = np.full(knots.count, 2 / spread)
    main[[0, -1]] = 1 / spread
    main[0] += ANCHOR_WEIGHT
    np.add.at(main, knots.left, square * (1 - knots.share) ** 2)
    np.add.at(main, knots.left + 1, square * knots.share**2)
    beside = np.full(knots.count - 1, -1 / spread)
    np.add.at(beside, knots.left, square * knots.share * (1 - knots.share))
    return main, beside


def _solve_tridiagonal(main: Array, beside: Array, right: Array) -> Array:
    """Of a symmetric matrix with three diagonals, shape (count, k): elimination down, then up (Thomas 1949)."""
    main, found = main.copy(), right.copy()
    for i in range(1, len(main)):
        factor = beside[i - 1] / main[i - 1]
        main[i] -= factor * beside[i - 1]
        found[i] -= factor * found[i - 1]
    found[-1] /= main[-1]
    for i in range(len(main) - 2, -1, -1):
        found[i] = (found[i] - beside[i] * found[i + 1]) / main[i]
    return found
