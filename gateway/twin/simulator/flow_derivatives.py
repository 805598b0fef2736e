"""Derivatives of the motion over integration steps, at fixed times, from the linearised equations along the computed motion.

The equations of the sensitivities, S' = F(t) S + G(t), are linear; a Magnus series solves them in each step. Only the rate of the
motion is differentiated symbolically: a whole step as one expression would have thirty times as many instructions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integrate import Trajectory

Array = NDArray[np.float64]
STEPS_AT_ONCE = 512
"""Steps whose intermediate results stay in the processor's cache."""
NODES = (0.5 - math.sqrt(15) / 10, 0.5, 0.5 + math.sqrt(15) / 10)
"""Where the equations are linearised in a step: the nodes of Gauss's quadrature."""
EXPONENTIAL_ORDER = 6
"""Terms of the exponential series: with 0.3 rad a step, the longest of any effect, the rest is below 1e-7."""


@dataclass(frozen=True, slots=True)
class FlowDerivatives:
    """Derivatives of the state at the end of each step, and the rates at both ends."""

    by_state: Array
    """By the state at the start, shape (steps, states, states)."""
    by_p: Array
    """Shape (steps, states, parameters)."""
    start_rates: Array
    """Shape (steps, states)."""
    end_rates: Array
    """Shape (steps, states)."""


def flow_derivatives(compiled: CompiledModel, trajectory: Trajectory, p: Array) -> FlowDerivatives:
    """Return the derivatives of all steps; those of a step do not contain that its ends may move."""
    steps, states = trajectory.starts.shape
    by = np.empty((steps, states, states + len(p)))
    rates = np.empty((2, steps, states))
    for first in range(0, steps, STEPS_AT_ONCE):
        part = slice(first, first + STEPS_AT_ONCE)
        begin_s, length_s = trajectory.begins_s[part], trajectory.lengths_s[part]
        ends = trajectory.starts[part], trajectory.ends[part]
        for rate, state, time_s in zip(rates, ends, (begin_s, begin_s + length_s), strict=True):
            rate[part] = compiled.rate([state.T, time_s, begin_s + length_s / 2], p)
        inside = [_interpolated(ends, rates[:, part], length_s[:, None], node) for node in NODES]
        times_s = [begin_s + node * length_s for node in NODES]
        inputs = [np.concatenate(inside).T, np.concatenate(times_s), np.tile(times_s[1], len(NODES))]
        first_node, middle, last = np.split(compiled.rate_jacobian(inputs, p), len(NODES))
        flow = _flow(first_node, middle, last, length_s[:, None, None])
        by[part] = compiled.constraint_jacobian([ends[1].T], p) @ flow
    return FlowDerivatives(np.ascontiguousarray(by[:, :, :states]), by[:, :, states:], *rates)


def _interpolated(states: Sequence[Array], rates: Array, length_s: Array, at: float) -> Array:
    """Return the states inside steps by a cubic through states and rates at both ends (Hermite interpolation)."""
    start, end = states
    rise = end - start
    slope, end_slope = length_s * rates
    cubic = slope + end_slope - 2 * rise
    inside: Array = start + at * (slope + at * (rise - slope - cubic + at * cubic))
    return inside


def _flow(first: Array, middle: Array, last: Array, length_s: Array) -> Array:
    """Return the solution of linear equations over a step, with [F G] at its three nodes, shape (steps, n, n + parameters).

    The Magnus series of order four (Blanes et al. 2009, eq. 253 and 254), and the series of the exponential.
    """
    n = first.shape[1]
    constant, linear = length_s * middle, math.sqrt(15) / 3 * length_s * (last - first)
    curvature = 10 / 3 * length_s * (last + first) - 20 / 3 * constant
    exponent = constant + (curvature - constant[:, :, :n] @ linear + linear[:, :, :n] @ constant) / 12
    matrix = np.ascontiguousarray(exponent[:, :, :n])
    flow = exponent / EXPONENTIAL_ORDER
    for order in range(EXPONENTIAL_ORDER - 1, 0, -1):
        flow = (exponent + matrix @ flow) / order
    flow[:, range(n), range(n)] += 1
    return flow
