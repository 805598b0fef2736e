"""Sensitivities of a trajectory: its derivatives by the initial states and by the parameters.

They are chained at fixed times, S+ = F_x S + F_p, to the accuracy of the integration. Where the rate jumps at a discontinuity,
whose time t depends on the parameters, S+ - S- = (f- - f+) dt/dp (Hairer et al. 1993, section I.14).
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integrate import Trajectory, hermite_polynomials
from gateway.twin.simulator.transition_matrix import transition_matrices

Array = NDArray[np.float64]
Visit = Callable[[slice, Array], None]
"""Takes steps and the sensitivities inside them, cubics of the share of a step that has passed (steps, 4, states, values)."""
STEPS_AT_ONCE = 512
"""Steps that are visited together. Basis: their matrices stay in the processor's cache, however long the recording is."""
STEPS_IN_BLOCK = 16
"""Steps that are combined. Basis: as many as make a block's own work small beside the call of numpy."""


def visit_sensitivities(
    compiled: CompiledModel, trajectory: Trajectory, initials: Array, p: Array, visit: Visit
) -> Array:
    """Visit the sensitivities of a trajectory from initial states (segments, z), in the order of the steps.

    Return those of the last state of each segment, whose time the parameters may move, shape (segments, states, values).
    """
    steps, states = trajectory.starts.shape
    n_initial = initials.shape[1]
    s = np.zeros((states, n_initial + len(p)))
    of_ends = np.empty((len(initials), *s.shape))
    begins = _smooth_parts(trajectory)
    until = {last: segment for segment, (_, last) in enumerate(trajectory.segments)}
    for first in range(0, steps, STEPS_AT_ONCE):
        part = slice(first, min(first + STEPS_AT_ONCE, steps))
        matrices = transition_matrices(compiled, trajectory, part, p)
        start, end = np.empty((2, part.stop - first, *s.shape))
        inside = (each for each in begins if first < each < part.stop)
        for begin, stop in pairwise([first, *inside, part.stop]):
            if begin in begins:
                s = _at_begin(compiled, trajectory, begin, *begins[begin], initials, p, s)
            chosen = slice(begin - first, stop - first)
            end[chosen] = _follow(matrices.of_step[chosen], s)
            start[begin - first], start[begin - first + 1 : stop - first] = s, end[begin - first : stop - first - 1]
            s = end[stop - first - 1]
            if stop in until:
                of_ends[until[stop]] = s
                last_by = trajectory.grids[until[stop]].nodes_by[-1]
                of_ends[until[stop], :, n_initial:] += trajectory.end_rates[stop - 1, :, None] * last_by
        slopes = [_applied(by, each) for by, each in ((matrices.of_start_slope, start), (matrices.of_end_slope, end))]
        visit(part, hermite_polynomials(start, end, *slopes))
    return of_ends


def evaluate_inside(polynomials: Array, step: NDArray[np.int64], share: Array) -> Array:
    """Return polynomials (steps, 4, ...) at shares of steps in ascending order, shape (n, ...)."""
    is_first = np.append(True, step[1:] != step[:-1])
    firsts, row = np.flatnonzero(is_first), np.cumsum(is_first) - 1
    column = np.arange(len(step)) - firsts[row]
    powers = np.zeros((len(firsts), int(column.max()) + 1, 4))
    powers[row, column] = share[:, None] ** np.arange(4)
    values = powers @ polynomials[step[firsts]].reshape(len(firsts), 4, -1)
    inside: Array = values[row, column].reshape(len(step), *polynomials.shape[2:])
    return inside


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


def _smooth_parts(trajectory: Trajectory) -> dict[int, tuple[int, int]]:
    """Return the first steps of parts in which the rate is continuous, in ascending order: segment, and node of its grid."""
    begins = {}
    for segment, (first, last) in enumerate(trajectory.segments):
        before, after = trajectory.end_rates[first : last - 1], trajectory.start_rates[first + 1 : last]
        jumps = ((before != after) & np.isfinite(before)).any(axis=1)
        nodes = {0, *(np.flatnonzero(jumps) + 1).tolist(), *trajectory.grids[segment].impulses}
        begins.update({first + node: (segment, node) for node in sorted(nodes)})
    return begins


def _at_begin(
    compiled: CompiledModel,
    trajectory: Trajectory,
    step: int,
    segment: int,
    node: int,
    initials: Array,
    p: Array,
    before: Array,
) -> Array:
    """Return the sensitivities at the begin of a segment, or after a jump of the rate or of the state."""
    grid, n_initial = trajectory.grids[segment], initials.shape[1]
    after, moved = before.copy(), -trajectory.start_rates[step]
    if node == 0:
        after = np.zeros_like(before)
        after[:, :n_initial] = compiled.state(initials[segment])[1].full()
    elif node in grid.impulses:
        found = compiled.impulses[grid.impulses[node]](trajectory.ends[step - 1], grid.nodes_s[node], p)
        by_x, by_p, by_time = (np.array(each) for each in found[1:])
        after, moved = by_x @ before, moved + by_x @ trajectory.end_rates[step - 1] + by_time[:, 0]
        after[:, n_initial:] += by_p
    else:
        moved = moved + trajectory.end_rates[step - 1]
    after[:, n_initial:] += moved[:, None] * grid.nodes_by[node]
    return after
