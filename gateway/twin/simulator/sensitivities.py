"""Sensitivities of a trajectory: its derivatives by the initial states and by the parameters.

They are chained at fixed times, S+ = F_x S + F_p, to the accuracy of the integration. Where the rate jumps at a discontinuity,
whose time t depends on the parameters, S+ - S- = (f- - f+) dt/dp (Hairer et al. 1993, section I.14). Within a step the equations
S' = F(t) S + G(t), linearised along the computed motion, are linear; a Magnus series solves them. Only the rate of the motion is
differentiated symbolically: a whole step as one expression would have thirty times as many instructions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integrate import Trajectory, hermite_polynomials

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
    linear = compiled.rate.jacobian([states.T, times_s, np.tile(middles_s, 3)], p)
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
