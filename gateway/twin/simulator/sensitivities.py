"""Sensitivities of a trajectory: total derivatives of exactly the steps that are taken, so exact for the computed prediction.

A step follows S+ = F_x S + F_p + F_t dt/dp + F_h dh/dp, where the time t and the length h of a step follow the discontinuities of
events.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integrate import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """Derivatives of the states at both ends of each step by initial state and parameters, shape (steps, states, values)."""

    at_step_start: Array
    at_step_end: Array


def sensitivities(compiled: CompiledModel, trajectory: Trajectory, initials: Array, p: Array) -> Sensitivities:
    """Return the derivatives of a trajectory from initial states (segments, z)."""
    steps, states = trajectory.starts.shape
    n_initial = initials.shape[1]
    jacobian = compiled.step_jacobian([trajectory.starts.T, trajectory.begins_s, trajectory.lengths_s], p)
    by_state = np.ascontiguousarray(jacobian[:, :, :states])
    by_p = _by_parameters(jacobian[:, :, states:], trajectory)
    start, end = np.empty((2, steps, states, n_initial + len(p)))
    for segment, (first, last) in enumerate(trajectory.segments):
        grid = trajectory.grids[segment]
        s = np.zeros(start.shape[1:])
        s[:, :n_initial] = compiled.state(initials[segment])[1].full()
        for begin, stop in pairwise(sorted({0, *grid.impulses, last - first})):
            if begin in grid.impulses:
                arguments = trajectory.ends[first + begin - 1], grid.nodes_s[begin], p
                s = _across_impulse(compiled.impulses[grid.impulses[begin]](*arguments), s, grid.nodes_by[begin])
            start[first + begin] = s
            for step in range(first + begin, first + stop):
                s = np.dot(by_state[step], s, out=end[step])
                s[:, n_initial:] += by_p[step]
            start[first + begin + 1 : first + stop] = end[first + begin : first + stop - 1]
    return Sensitivities(start, end)


def _by_parameters(jacobian: Array, trajectory: Trajectory) -> Array:
    """Return the derivatives of each step by the parameters, with those by the times of both its ends.

    `jacobian`: by time and length of the step, then by p.
    """
    added: Array = jacobian[:, :, 2:].copy()
    begins_by, lengths_by = trajectory.begins_by, trajectory.lengths_by
    moving = np.flatnonzero(begins_by.any(axis=1) | lengths_by.any(axis=1))
    added[moving] += jacobian[moving, :, 0, None] * begins_by[moving, None]
    added[moving] += jacobian[moving, :, 1, None] * lengths_by[moving, None]
    return added


def _across_impulse(impulse: tuple[Any, ...], s: Array, time_by: Array) -> Array:
    """Return the sensitivities after an impulse."""
    by_x, by_p, by_time = (np.array(each) for each in impulse[1:])
    after: Array = by_x @ s
    after[:, s.shape[1] - by_p.shape[1] :] += by_p + by_time * time_by
    return after
