"""Damped Gauss-Newton for small smooth problems (Levenberg 1944, Marquardt 1963)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array

MAX_FIT_ITERATIONS = 60
"""Basis: a choice; usual fits need far fewer, and one that does not converge ends soon."""
PARAMETER_STEP = 1e-6
"""Step of the derivatives, relative to the scale of a parameter. Basis: a choice; between rounding and curvature, above the root
of rounding (1.5e-8)."""
CONVERGED_DECREASE = 1e-9
"""Relative decrease of the sum of squares below which the fit has converged. Basis: a choice; far below what noise contributes,
above rounding."""
MAX_DAMPING = 1e8
"""Basis: a choice; a step is then too small to matter, and the fit has converged."""


@dataclass(frozen=True, slots=True)
class LeastSquaresFit:
    """Solution of a least-squares problem."""

    parameters: Array
    residual: Array
    covariance: Array
    """Covariance of the parameters, scaled by the residual."""


def jacobian(function: Callable[[Array], Array], parameters: Array, scale: Array) -> Array:
    """Return the derivatives by central differences, shape (n, p); `scale` is the magnitude of each parameter."""
    columns = []
    for place, size in enumerate(scale):
        step = np.zeros_like(parameters)
        step[place] = PARAMETER_STEP * size
        columns.append((function(parameters + step) - function(parameters - step)) / (2 * step[place]))
    return np.column_stack(columns)


def fit_least_squares(residual_of: Callable[[Array], Array], start: Array, scale: Array) -> LeastSquaresFit | None:
    """Minimise the sum of squares of `residual_of(parameters)`; None if the solution is not determined."""
    parameters, residual = start, residual_of(start)
    cost, damping = float(residual @ residual), 1e-3
    for _ in range(MAX_FIT_ITERATIONS):
        slope = jacobian(residual_of, parameters, scale) * scale
        normal, gradient = slope.T @ slope, slope.T @ residual
        improved = False
        while damping < MAX_DAMPING and not improved:
            damped = normal + damping * np.diag(np.diag(normal) + np.finfo(float).tiny)
            try:
                trial = parameters - scale * np.linalg.solve(damped, gradient)
            except np.linalg.LinAlgError:
                return None
            trial_residual = residual_of(trial)
            trial_cost = float(trial_residual @ trial_residual)
            improved = trial_cost < cost  # false for NaN
            damping = damping / 10 if improved else damping * 10
        if not improved:
            break
        decrease = 1 - trial_cost / cost
        parameters, residual, cost = trial, trial_residual, trial_cost
        if decrease < CONVERGED_DECREASE or cost == 0:
            break
    return _with_covariance(residual_of, parameters, residual, scale)


def _with_covariance(
    residual_of: Callable[[Array], Array], parameters: Array, residual: Array, scale: Array
) -> LeastSquaresFit | None:
    slope = jacobian(residual_of, parameters, scale) * scale
    normal = slope.T @ slope
    freedom = len(residual) - len(parameters)
    if (
        freedom < 1
        or not np.all(np.isfinite(normal))
        or np.linalg.matrix_rank(normal, hermitian=True) < len(parameters)
    ):
        return None
    inverse = np.linalg.inv(normal) * np.outer(scale, scale)
    return LeastSquaresFit(parameters, residual, inverse * float(residual @ residual) / freedom)
