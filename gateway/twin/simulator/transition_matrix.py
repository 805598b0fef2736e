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
STEPS_AT_ONCE = 512
"""Steps whose intermediate results stay in the processor's cache."""
EXPONENTIAL_ORDER = 6
"""Terms of the exponential series: with a quarter of a radian a step, the longest of any effect, the rest is below 1e-7."""


@dataclass(frozen=True, slots=True)
class TransitionMatrices:
    """Derivatives by a state and by the parameters, at fixed times, shape (steps, states, states + parameters)."""

    of_step: Array
    """Of the state at the end of each step, by that at its start."""
    of_start_slope: Array
    """Of the rate at the start times the length of the step, by the state there."""
    of_end_slope: Array
    """The same at the end."""


def transition_matrices(compiled: CompiledModel, trajectory: Trajectory, p: Array) -> TransitionMatrices:
    """Return the matrices of all steps."""
    steps, states = trajectory.starts.shape
    by = np.empty((3, steps, states, states + len(p)))
    middles = trajectory.polynomials.swapaxes(0, 1) * 0.5 ** np.arange(4)[:, None, None]
    at_nodes = trajectory.starts, middles.sum(axis=0), trajectory.ends
    times_s = trajectory.begins_s, trajectory.middles_s, trajectory.begins_s + trajectory.lengths_s
    for first in range(0, steps, STEPS_AT_ONCE):
        part = slice(first, first + STEPS_AT_ONCE)
        inputs = [np.concatenate([each[part] for each in at_nodes]).T, np.concatenate([each[part] for each in times_s])]
        linear = compiled.rate_jacobian([*inputs, np.tile(times_s[1][part], 3)], p)
        linear *= np.tile(trajectory.lengths_s[part], 3)[:, None, None]
        start, middle, end = np.split(linear, 3)
        transition = compiled.constraint_jacobian([trajectory.ends[part].T], p) @ _solve(start, middle, end)
        by[0, part], by[1, part], by[2, part] = transition, start, end
    return TransitionMatrices(*by)


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
