"""Sensitivities of a trajectory: its derivatives by the initial states and by the parameters.

They are chained at fixed times, S+ = F_x S + F_p, to the accuracy of the integration. Where the rate jumps at a discontinuity,
whose time t depends on the parameters, S+ - S- = (f- - f+) dt/dp (Hairer et al. 1993, section I.14).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.flow_derivatives import FlowDerivatives, flow_derivatives
from gateway.twin.simulator.integrate import Trajectory
from gateway.twin.simulator.integration_grid import IntegrationGrid

Array = NDArray[np.float64]
STEPS_IN_BLOCK = 16
"""Steps that are combined: as many as make a block's own work small beside the call of numpy."""


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """Derivatives of the states at both ends of each step by initial state and parameters, shape (steps, states, values).

    They contain that the parameters may move the ends of a step.
    """

    at_step_start: Array
    at_step_end: Array


def sensitivities(compiled: CompiledModel, trajectory: Trajectory, initials: Array, p: Array) -> Sensitivities:
    """Return the derivatives of a trajectory from initial states (segments, z)."""
    steps, states = trajectory.starts.shape
    n_initial = initials.shape[1]
    flow = flow_derivatives(compiled, trajectory, p)
    start, end = np.empty((2, steps, states, n_initial + len(p)))
    for segment, (first, last) in enumerate(trajectory.segments):
        grid = trajectory.grids[segment]
        s = np.zeros(start.shape[1:])
        s[:, :n_initial] = compiled.state(initials[segment])[1].full()
        s[:, n_initial:] = -flow.start_rates[first, :, None] * grid.nodes_by[0]
        for begin, stop in pairwise(sorted({0, *_jumps(flow, grid, first, last), last - first})):
            if begin > 0:
                before = trajectory.ends[first + begin - 1], grid.nodes_s[begin], p
                impulse = compiled.impulses[grid.impulses[begin]](*before)[1:] if begin in grid.impulses else None
                rates = flow.end_rates[first + begin - 1], flow.start_rates[first + begin]
                s = _across_jump(s, *rates, grid.nodes_by[begin], impulse)
            part = slice(first + begin, first + stop)
            end[part] = _follow(flow.by_state[part], flow.by_p[part], s)
            start[first + begin], start[first + begin + 1 : first + stop] = s, end[first + begin : first + stop - 1]
            s = end[first + stop - 1]
    start[:, :, n_initial:] += flow.start_rates[:, :, None] * trajectory.begins_by[:, None]
    end[:, :, n_initial:] += flow.end_rates[:, :, None] * (trajectory.begins_by + trajectory.lengths_by)[:, None]
    return Sensitivities(start, end)


def _follow(by_state: Array, by_p: Array, s: Array) -> Array:
    """Return the sensitivities at the ends of consecutive steps.

    Steps are combined to blocks, all blocks at once, and then only the blocks one after the other.
    """
    steps, states = by_state.shape[:2]
    n_initial = s.shape[1] - by_p.shape[2]
    blocks = -(-steps // STEPS_IN_BLOCK)
    from_block = np.zeros((blocks * STEPS_IN_BLOCK, states, states + by_p.shape[2]))
    from_block[:steps, :, :states], from_block[:steps, :, states:] = by_state, by_p
    from_block = np.ascontiguousarray(from_block.reshape(blocks, STEPS_IN_BLOCK, *from_block.shape[1:]).swapaxes(0, 1))
    for before, step in pairwise(from_block):
        added = step[:, :, states:].copy()
        step[:] = step[:, :, :states] @ before
        step[:, :, states:] += added
    at_block = np.empty((blocks, *s.shape))
    for block, whole in enumerate(from_block[-1]):
        at_block[block] = s
        s = whole[:, :states] @ s
        s[:, n_initial:] += whole[:, states:]
    after: Array = from_block[..., :states] @ at_block
    after[..., n_initial:] += from_block[..., states:]
    return after.swapaxes(0, 1).reshape(-1, *s.shape)[:steps]


def _jumps(flow: FlowDerivatives, grid: IntegrationGrid, first: int, last: int) -> set[int]:
    """Return the nodes inside a segment at which the rate is not continuous."""
    jumps = (flow.end_rates[first : last - 1] != flow.start_rates[first + 1 : last]).any(axis=1)
    return {*(np.flatnonzero(jumps) + 1).tolist(), *grid.impulses}


def _across_jump(
    s: Array, rate_before: Array, rate_after: Array, time_by: Array, impulse: Sequence[Any] | None
) -> Array:
    """Return the sensitivities after a jump of the rate at a time, or of the state (`impulse`: by state, p and time)."""
    n_initial = s.shape[1] - len(time_by)
    after, moved = s.copy(), rate_before - rate_after
    if impulse is not None:
        by_x, by_p, by_time = (np.array(each) for each in impulse)
        after, moved = by_x @ s, by_x @ rate_before + by_time[:, 0] - rate_after
        after[:, n_initial:] += by_p
    after[:, n_initial:] += moved[:, None] * time_by
    return after
