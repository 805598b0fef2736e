"""Integration of one segment of the motion, with its sensitivities.

The sensitivities are total derivatives of exactly the steps that are taken: S+ = F_x S + F_p + F_t dt/dp + F_h dh/dp, where the
time t and the length h of a step follow the discontinuities of events. So they are exact for the computed prediction.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integration_grid import IntegrationGrid, Times, make_grid

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """Derivatives of the states at both ends of each step by initial state and parameters, shape (steps, states, values)."""

    at_step_start: Array
    at_step_end: Array


@dataclass(frozen=True, slots=True)
class Trajectory:
    """States at both ends of each step; the end of a step differs from the start of the next at an impulse."""

    grid: IntegrationGrid
    step_starts: Array
    """Shape (steps, states)."""
    step_ends: Array
    """Shape (steps, states)."""
    sensitivities: Sensitivities | None


def integrate(
    compiled: CompiledModel, initial: Array, p: Array, from_s: float, until_s: float, with_sensitivities: bool
) -> Trajectory:
    """Integrate from an initial state z between two recorded times since the first sample."""
    grid = _grid(compiled, p, from_s, until_s)
    x, x_by_initial = (each.full() for each in compiled.state(initial))
    state = x[:, 0]
    steps = len(grid.nodes_s) - 1
    step_starts, step_ends = np.empty((steps, len(state))), np.empty((steps, len(state)))
    for first, last in pairwise(sorted({0, *grid.impulses, steps})):
        if first in grid.impulses:
            state = compiled.impulses[grid.impulses[first]](state, grid.nodes_s[first], p)[0].full()[:, 0]
        step_ends[first:last] = compiled.steps(state, grid.nodes_s[first:last], grid.steps_s[first:last], p)
        step_starts[first], step_starts[first + 1 : last] = state, step_ends[first : last - 1]
        state = step_ends[last - 1]
    sensitivities = (
        _sensitivities(compiled, grid, step_starts, step_ends, x_by_initial, p) if with_sensitivities else None
    )
    return Trajectory(grid, step_starts, step_ends, sensitivities)


def _grid(compiled: CompiledModel, p: Array, from_s: float, until_s: float) -> IntegrationGrid:
    recorded = [np.array([from_s, until_s])]
    bounds = Times(compiled.true_time(recorded, p)[:, 0], compiled.true_time_by_p(recorded, p)[:, 0])
    times, times_by = (each.full() for each in compiled.discontinuities(p))
    return make_grid(bounds, Times(times[:, 0], times_by), compiled.impulses, compiled.step_s(p))


def _sensitivities(
    compiled: CompiledModel, grid: IntegrationGrid, step_starts: Array, step_ends: Array, x_by_initial: Array, p: Array
) -> Sensitivities:
    steps, states = step_starts.shape
    n_initial = x_by_initial.shape[1]
    jacobian = compiled.step_jacobian([step_starts.T, grid.nodes_s[:-1], grid.steps_s], p)
    by_state, by_parameters = jacobian[:, :, :states], _step_derivatives(jacobian, grid, n_initial)
    at_start, at_end = np.empty((2, steps, states, n_initial + len(p)))
    s = np.zeros(at_start.shape[1:])
    s[:, :n_initial] = x_by_initial
    for step in range(steps):
        if step in grid.impulses:
            impulse = compiled.impulses[grid.impulses[step]](step_ends[step - 1], grid.nodes_s[step], p)
            s = _across_impulse(impulse, s, grid.nodes_by[step])
        at_start[step] = s
        s = by_state[step] @ s + by_parameters[step]
        at_end[step] = s
    return Sensitivities(at_start, at_end)


def _step_derivatives(jacobian: Array, grid: IntegrationGrid, n_initial: int) -> Array:
    """Return what each step adds to the sensitivities: by the parameters, and by the times of both its ends."""
    states = jacobian.shape[1]
    added = np.zeros((len(jacobian), states, n_initial + grid.nodes_by.shape[1]))
    added[:, :, n_initial:] = jacobian[:, :, states + 2 :]
    time_by, step_by = grid.nodes_by[:-1], np.diff(grid.nodes_by, axis=0)
    moving = np.flatnonzero(time_by.any(axis=1) | step_by.any(axis=1))
    added[moving, :, n_initial:] += jacobian[moving, :, states, None] * time_by[moving, None]
    added[moving, :, n_initial:] += jacobian[moving, :, states + 1, None] * step_by[moving, None]
    return added


def _across_impulse(impulse: tuple[Any, ...], s: Array, time_by: Array) -> Array:
    """Return the sensitivities after an impulse."""
    by_x, by_p, by_time = (np.array(each) for each in impulse[1:])
    after: Array = by_x @ s
    after[:, s.shape[1] - by_p.shape[1] :] += by_p + by_time * time_by
    return after
