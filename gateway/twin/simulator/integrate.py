"""One stretch of motion, integrated from its start, with its sensitivities carried along.

Sensitivities are total derivatives of the very steps that are taken: S+ = F_x S + F_p + F_t dt/dp + F_h dh/dp, where t and h,
the time and length of a step, follow the edges of events. So they are exact for the prediction as it is computed.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integration_grid import Grid, SampleTimes, grid

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """Of the states at both ends of each step by the start and the parameters, shape (steps, states, start + parameters)."""

    begins: Array
    ends: Array


@dataclass(frozen=True, slots=True)
class Trajectory:
    """States at both ends of each step: they differ from step to step where a blow strikes."""

    grid: Grid
    begins: Array
    """Shape (steps, states)."""
    ends: Array
    """Shape (steps, states)."""
    by: Sensitivities | None


def integrate(
    compiled: CompiledModel, start: Array, p: Array, from_s: float, until_s: float, sensitive: bool
) -> Trajectory:
    """Integrate from a start (coordinates z) between two times as recorded since the first sample."""
    nodes = _grid(compiled, p, from_s, until_s)
    state, state_by = (each.full() for each in compiled.state(start))
    steps = len(nodes.nodes_s) - 1
    begins, ends = np.empty((steps, len(state))), np.empty((steps, len(state)))
    bounds = sorted({0, *nodes.kicks, steps})
    x = state[:, 0]
    for first, last in pairwise(bounds):
        if first in nodes.kicks:
            x = compiled.velocity_jumps[nodes.kicks[first]](x, nodes.nodes_s[first], p)[0].full()[:, 0]
        ends[first:last] = compiled.steps(x, nodes.nodes_s[first:last], nodes.steps_s[first:last], p)
        begins[first], begins[first + 1 : last] = x, ends[first : last - 1]
        x = ends[last - 1]
    found = _sensitivities(compiled, nodes, begins, ends, state_by, p) if sensitive else None
    return Trajectory(nodes, begins, ends, found)


def _grid(compiled: CompiledModel, p: Array, from_s: float, until_s: float) -> Grid:
    recorded = [np.array([from_s, until_s])]
    bounds = SampleTimes(compiled.true_time(recorded, p)[:, 0], compiled.true_time_by_p(recorded, p)[:, 0])
    edges, edges_by = (each.full() for each in compiled.edges(p))
    return grid(bounds, SampleTimes(edges[:, 0], edges_by), compiled.velocity_jumps, compiled.step_s(p))


def _sensitivities(
    compiled: CompiledModel, nodes: Grid, begins: Array, ends: Array, state_by: Array, p: Array
) -> Sensitivities:
    steps, states = begins.shape
    starts = state_by.shape[1]
    jacobian = compiled.step_jacobian([begins.T, nodes.nodes_s[:-1], nodes.steps_s], p)
    along, pushed = jacobian[:, :, :states], _propagate_sensitivities(jacobian, nodes, starts)
    before, after = np.empty((2, steps, states, starts + len(p)))
    s = np.zeros(before.shape[1:])
    s[:, :starts] = state_by
    for step in range(steps):
        if step in nodes.kicks:
            at = ends[step - 1], nodes.nodes_s[step], p
            s = _apply_jump(compiled.velocity_jumps[nodes.kicks[step]](*at), s, nodes.nodes_by[step])
        before[step] = s
        s = along[step] @ s + pushed[step]
        after[step] = s
    return Sensitivities(before, after)


def _propagate_sensitivities(jacobian: Array, nodes: Grid, starts: int) -> Array:
    """What each step adds to the sensitivities: by the parameters, and by the times of its ends."""
    states = jacobian.shape[1]
    pushed = np.zeros((len(jacobian), states, starts + nodes.nodes_by.shape[1]))
    pushed[:, :, starts:] = jacobian[:, :, states + 2 :]
    time_by, step_by = nodes.nodes_by[:-1], np.diff(nodes.nodes_by, axis=0)
    moving = np.flatnonzero(time_by.any(axis=1) | step_by.any(axis=1))
    pushed[moving, :, starts:] += jacobian[moving, :, states, None] * time_by[moving, None]
    pushed[moving, :, starts:] += jacobian[moving, :, states + 1, None] * step_by[moving, None]
    return pushed


def _apply_jump(kicked: tuple[object, ...], s: Array, time_by: Array) -> Array:
    by_x, by_p, by_time = (np.array(each) for each in kicked[1:])
    after: Array = by_x @ s
    after[:, s.shape[1] - by_p.shape[1] :] += by_p + by_time * time_by
    return after
