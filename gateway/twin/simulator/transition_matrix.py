"""State-transition matrices of integration steps, from the equations linearised along the computed motion.

The equations of the sensitivities, S' = F(t) S + G(t), are linear; a Magnus series solves them in each step. Only the rate of the
motion is differentiated symbolically: a whole step as one expression would have thirty times as many instructions.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integrate import Trajectory

Array = NDArray[np.float64]
EXPONENTIAL_ORDER = 6
"""Terms of the exponential series. Basis: with a quarter of a radian a step, the longest of any effect, the rest is below
1e-7."""


@dataclass(frozen=True, slots=True)
class TransitionMatrices:
    """Derivatives by a state and by the parameters, at fixed times, shape (steps, states, states + parameters)."""

    of_step: Array
    """Of the state at the end of each step, by that at its start."""
    of_start_slope: Array
    """Of the rate at the start times the length of the step, by the state there."""
    of_end_slope: Array
    """The same at the end."""


def transition_matrices(compiled: CompiledModel, trajectory: Trajectory, steps: slice, p: Array) -> TransitionMatrices:
    """Return the matrices of some steps of a trajectory."""
    lengths_s, middles_s, ends = trajectory.lengths_s[steps], trajectory.middles_s[steps], trajectory.ends[steps]
    middles = (trajectory.polynomials(steps) * 0.5 ** np.arange(4)[:, None]).sum(axis=1)
    states = np.concatenate([trajectory.starts[steps], middles, ends])
    times_s = np.concatenate([middles_s - lengths_s / 2, middles_s, middles_s + lengths_s / 2])
    linear = compiled.rate_jacobian([states.T, times_s, np.tile(middles_s, 3)], p)
    linear *= np.tile(lengths_s, 3)[:, None, None]
    start, middle, end = np.split(linear, 3)
    return TransitionMatrices(compiled.constraint_jacobian([ends.T], p) @ _solve(start, middle, end), start, end)


def _solve(start: Array, middle: Array, end: Array) -> Array:
    """Return the solution of linear equations over a step, with [F G] times its length at three nodes.

    The Magnus series of order four by Simpson's rule (Blanes et al. 2009, section 5.4), and the series of the exponential. Shapes
    are (steps, n, n + parameters).
    """
    n = start.shape[1]
    exponent = (start + 4 * middle + end) / 6 - (start[:, :, :n] @ end - end[:, :, :n] @ start) / 12
    matrix = np.ascontiguousarray(exponent[:, :, :n])
    solution = exponent / EXPONENTIAL_ORDER
    for order in range(EXPONENTIAL_ORDER - 1, 0, -1):
        solution = (exponent + matrix @ solution) / order
    solution[:, range(n), range(n)] += 1
    return solution
