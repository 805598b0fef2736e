"""What every fit is made of: damped steps inside bounds (Levenberg 1944, Marquardt 1963), and the result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
FIT_ITERATIONS = 8
"""Iterations of most fits; nearly all converge earlier."""
REFINEMENT_ITERATIONS = 3
"""Iterations of a fit that starts near its minimum, or in which the samples are nearly linear."""
REFINE_ITERATIONS = 20
"""Iterations of a fit that continues along a narrow valley of chi-square."""
SCREENING_ITERATIONS = 6
"""Iterations of a fit that decides only whether a model is consistent with the data, or which guess is the best."""
LARGE_SWING_ITERATIONS = 30
"""Iterations of a fit of a large swing, or of one seen along the rope: its period depends on every parameter, its readings are
not nearly linear in the initial state, and its segments join slowly."""
Limits = Mapping[str, tuple[float, float]]
"""Lower and upper bounds of effect values by label, where a recording sets narrower ones than the effect."""
NO_LIMITS: Limits = {}
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


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to observations."""

    names: tuple[str, ...]
    """The effects of the model."""
    values: Array
    """Initial state and effect values, in the simulator's order."""
    free: NDArray[np.bool_]
    """Which values were fitted."""
    force_g: Array
    """Simulated, shape (n, 3)."""
    chi2: float
    """Sum over the samples that count."""
    normal: Array
    """Normal matrix of the free values, J^T J."""
    jacobian: Array
    """Derivatives of the simulation by all values, in sigma, shape (n, 3, values); of the last linearisation."""

    def covariance(self) -> Array:
        """Return the covariance of the free values under white noise; by the pseudo-inverse where some are not determined."""
        diagonal = np.diag(self.normal)
        scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        covariance: Array = np.linalg.pinv(self.normal / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
        return covariance


@dataclass(frozen=True, slots=True)
class FitProblem:
    """What stays the same during a fit: a model, a recording in segments, what is fitted, and who is told of it."""

    simulator: Simulator
    observations: Observations
    free: NDArray[np.bool_]
    """Which of the values of initial state and effects are fitted, shape (values,)."""
    first_samples: Sequence[int] = (0,)
    """Of the segments, or of the windows of a large swing."""
    tick: Callable[[], None] = lambda: None
    """Called before each simulation."""
    limits: Limits = field(default_factory=dict)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of all values, shape (values,) each."""
        bounds = [self.limits.get(each.label, (each.lower, each.upper)) for each in self.simulator.parameters]
        lower, upper = np.array(bounds, dtype=np.float64).T
        return lower, upper

    @property
    def as_one_segment(self) -> "FitProblem":
        """The same without segments."""
        return replace(self, first_samples=(0,))
