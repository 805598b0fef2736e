"""Damped Gauss-Newton steps inside bounds (Levenberg 1944, Marquardt 1963)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FIT_ITERATIONS = 8
"""Iterations of most fits; nearly all converge earlier."""
REFINEMENT_ITERATIONS = 3
"""Iterations of a fit that starts near its minimum, or in which the samples are nearly linear."""
SCREENING_ITERATIONS = 6
"""Iterations of a fit that decides only whether a model is consistent with the data."""
MIN_SCALE = 1e-12
"""Added to the scale of each parameter, so that one without any sensitivity gives no division by zero."""


def solve_damped(normal: Array, gradient: Array, damping: float) -> Array:
    """Return the solution of normal equations (k, k) and (k,); `damping` is added to the diagonal after scaling it to 1."""
    scale = np.sqrt(np.diag(normal)) + MIN_SCALE
    matrix = normal / np.outer(scale, scale) + damping * np.eye(len(scale))
    solution: Array = np.linalg.solve(matrix, gradient / scale) / scale
    return solution


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """A linearised least-squares problem in k values."""

    normal: Array
    """J^T J, shape (k, k)."""
    gradient: Array
    """J^T r, shape (k,)."""

    @classmethod
    def from_jacobian(cls, jacobian: Array, residual: Array) -> "NormalEquations":
        """Return the equations of a Jacobian (..., k) and a residual (...)."""
        flat = jacobian.reshape(-1, jacobian.shape[-1])
        return cls(flat.T @ flat, flat.T @ residual.ravel())

    def with_prior(self, precision: Array, pull: Array) -> "NormalEquations":
        """Return the equations with a prior of this precision (k,), which pulls the values (k,)."""
        return NormalEquations(self.normal + np.diag(precision), self.gradient + pull)

    def step(self, free: NDArray[np.bool_], damping: float, held: Array | None = None) -> Array:
        """Return a damped step of the free values, shape (k,); the others take the step `held` (k,), zero by default."""
        step = np.zeros(len(free)) if held is None else held.copy()
        moving, fixed = np.flatnonzero(free), np.flatnonzero(~free)
        gradient = self.gradient[moving] - self.normal[np.ix_(moving, fixed)] @ step[fixed]
        step[moving] = solve_damped(self.normal[np.ix_(moving, moving)], gradient, damping)
        return step

    def bounded_step(self, free: NDArray[np.bool_], smallest_step: Array, largest_step: Array, damping: float) -> Array:
        """Return a damped step of the free values between two limits, shape (k,).

        A value that would exceed a limit is set to it, and the others are solved again (active set).
        """
        step, moving = np.zeros(len(free)), free.copy()
        while moving.any():
            step = self.step(moving, damping, step)
            exceeding = moving & ((step < smallest_step) | (step > largest_step))
            if not exceeding.any():
                break
            step[exceeding] = np.clip(step, smallest_step, largest_step)[exceeding]
            moving &= ~exceeding
        return step
