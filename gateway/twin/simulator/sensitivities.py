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
from gateway.twin.simulator.integrate import Trajectory, hermite_polynomials
from gateway.twin.simulator.integration_grid import IntegrationGrid
from gateway.twin.simulator.transition_matrix import transition_matrices

Array = NDArray[np.float64]
STEPS_IN_BLOCK = 16
"""Steps that are combined: as many as make a block's own work small beside the call of numpy."""


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """Derivatives of a trajectory by initial state and parameters, `values` in the shapes."""

    polynomials: Array
    """At fixed times inside each step, cubics of the share of the step that has passed, shape (steps, 4, states, values)."""
    of_ends: Array
    """Of the last state of each segment, whose time the parameters may move, shape (segments, states, values)."""

    def inside(self, step: NDArray[np.int64], share: Array) -> Array:
        """Return them at shares of steps in ascending order, shape (n, states, values)."""
        with_samples, firsts, row = np.unique(step, return_index=True, return_inverse=True)
        column = np.arange(len(step)) - firsts[row]
        powers = np.zeros((len(with_samples), int(column.max()) + 1, 4))
        powers[row, column] = share[:, None] ** np.arange(4)
        states, values = self.polynomials.shape[2:]
        found = powers @ self.polynomials[with_samples].reshape(len(with_samples), 4, states * values)
        inside: Array = found[row, column].reshape(len(step), states, values)
        return inside


def sensitivities(compiled: CompiledModel, trajectory: Trajectory, initials: Array, p: Array) -> Sensitivities:
    """Return the derivatives of a trajectory from initial states (segments, z)."""
    steps, states = trajectory.starts.shape
    n_initial = initials.shape[1]
    matrices = transition_matrices(compiled, trajectory, p)
    start, end = np.empty((2, steps, states, n_initial + len(p)))
    of_ends = np.empty((len(initials), *start.shape[1:]))
    for segment, (first, last) in enumerate(trajectory.segments):
        grid = trajectory.grids[segment]
        s = np.zeros(start.shape[1:])
        s[:, :n_initial] = compiled.state(initials[segment])[1].full()
        s[:, n_initial:] = -trajectory.start_rates[first, :, None] * grid.nodes_by[0]
        for begin, stop in pairwise(sorted({0, *_jumps(trajectory, grid, first, last), last - first})):
            if begin > 0:
                before = trajectory.ends[first + begin - 1], grid.nodes_s[begin], p
                impulse = compiled.impulses[grid.impulses[begin]](*before)[1:] if begin in grid.impulses else None
                rates = trajectory.end_rates[first + begin - 1], trajectory.start_rates[first + begin]
                s = _across_jump(s, *rates, grid.nodes_by[begin], impulse)
            part = slice(first + begin, first + stop)
            end[part] = _follow(matrices.of_step[part], s)
            start[first + begin], start[first + begin + 1 : first + stop] = s, end[first + begin : first + stop - 1]
            s = end[first + stop - 1]
        of_ends[segment] = s
        of_ends[segment, :, n_initial:] += trajectory.end_rates[last - 1, :, None] * grid.nodes_by[-1]
    slopes = [_applied(by, s) for by, s in ((matrices.of_start_slope, start), (matrices.of_end_slope, end))]
    return Sensitivities(hermite_polynomials(start, end, *slopes), of_ends)


def _applied(by: Array, s: Array) -> Array:
    """Return derivatives by state and parameters times the sensitivities of the state, shape (..., states, values)."""
    states = s.shape[-2]
    product: Array = by[..., :states] @ s
    product[..., s.shape[-1] - by.shape[-1] + states :] += by[..., states:]
    return product


def _follow(of_step: Array, s: Array) -> Array:
    """Return the sensitivities at the ends of consecutive steps.

    Steps are combined to blocks, all blocks at once, and then only the blocks one after the other.
    """
    steps, states, values = of_step.shape
    blocks = -(-steps // STEPS_IN_BLOCK)
    from_block = np.zeros((blocks * STEPS_IN_BLOCK, states, values))
    from_block[:steps] = of_step
    from_block = np.ascontiguousarray(from_block.reshape(blocks, STEPS_IN_BLOCK, states, values).swapaxes(0, 1))
    for before, step in pairwise(from_block):
        added = step[:, :, states:].copy()
        step[:] = step[:, :, :states] @ before
        step[:, :, states:] += added
    at_block = np.empty((blocks, *s.shape))
    for block, whole in enumerate(from_block[-1]):
        at_block[block] = s
        s = _applied(whole, s)
    return _applied(from_block, at_block).swapaxes(0, 1).reshape(-1, *s.shape)[:steps]


def _jumps(trajectory: Trajectory, grid: IntegrationGrid, first: int, last: int) -> set[int]:
    """Return the nodes inside a segment at which the rate is not continuous."""
    jumps = (trajectory.end_rates[first : last - 1] != trajectory.start_rates[first + 1 : last]).any(axis=1)
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
