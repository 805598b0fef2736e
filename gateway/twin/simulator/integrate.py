"""Integration of the motion over segments, each from its own initial state, between regular nodes and discontinuities."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel

Array = NDArray[np.float64]

MIN_SPACING_S = 1e-6
"""A regular node closer than this to a discontinuity is left out. Basis: a choice; above rounding, far below a step."""
RAMP_STEPS = 8
"""Least steps between two discontinuities. Basis: a force may rise from one to the next."""
ROUNDING_STEPS = 1e-9
"""Excess over a whole number of steps that is a rounding error. Basis: above rounding (1e-16) of some million steps."""


@dataclass(frozen=True, slots=True)
class Times:
    """Times and their derivatives by the parameters."""

    time_s: Array
    """Shape (n,)."""
    by: Array
    """Shape (n, parameters)."""


@dataclass(frozen=True, slots=True)
class IntegrationGrid:
    """Nodes in ascending order."""

    nodes_s: Array
    """Shape (nodes,)."""
    nodes_by: Array
    """Derivatives by the parameters, shape (nodes, parameters)."""
    impulses: dict[int, int]
    """Nodes at which the state jumps, each with the index of its discontinuity."""

    @property
    def steps_s(self) -> Array:
        """Lengths of the steps, shape (nodes - 1,)."""
        return np.diff(self.nodes_s)


def make_grid(bounds: Times, discontinuities: Times, with_impulse: Collection[int], step_s: float) -> IntegrationGrid:
    """Return nodes from the first bound to the second, at most `step_s` apart, with one at each discontinuity between them."""
    first_s, last_s = bounds.time_s
    steps = max(1, int(np.ceil((last_s - first_s) / step_s - ROUNDING_STEPS)))
    regular_s = np.linspace(first_s, last_s, steps + 1)
    regular_by = np.linspace(bounds.by[0], bounds.by[1], steps + 1)
    inside = np.flatnonzero(
        (discontinuities.time_s > first_s + MIN_SPACING_S) & (discontinuities.time_s < last_s - MIN_SPACING_S)
    )
    distance_s = np.abs(regular_s[:, None] - discontinuities.time_s[inside]).min(axis=1, initial=np.inf)
    kept = distance_s > MIN_SPACING_S
    kept[[0, -1]] = True
    ramps = _inside_ramps(Times(discontinuities.time_s[inside], discontinuities.by[inside]), step_s)
    nodes_s = np.concatenate([regular_s[kept], discontinuities.time_s[inside], ramps.time_s])
    order = np.argsort(nodes_s, kind="stable")
    node_of = np.empty_like(order)
    node_of[order] = np.arange(len(order))
    impulses = {int(node_of[kept.sum() + i]): int(each) for i, each in enumerate(inside) if each in with_impulse}
    nodes_by = np.concatenate([regular_by[kept], discontinuities.by[inside], ramps.by])
    return IntegrationGrid(nodes_s[order], nodes_by[order], impulses)


def _inside_ramps(discontinuities: Times, step_s: float) -> Times:
    """Return nodes between discontinuities that are so close to each other that regular nodes are too few."""
    order = np.argsort(discontinuities.time_s, kind="stable")
    times_s, by = discontinuities.time_s[order], discontinuities.by[order]
    gaps_s = np.diff(times_s)
    short = np.flatnonzero((gaps_s > MIN_SPACING_S) & (gaps_s < RAMP_STEPS * step_s))
    share = np.arange(1, RAMP_STEPS)[:, None] / RAMP_STEPS
    inside_by = by[short] + share[:, :, None] * np.diff(by, axis=0)[short]
    return Times(
        (times_s[short] + share * gaps_s[short]).ravel(), inside_by.reshape(share.size * len(short), by.shape[1])
    )


ALL = slice(None)


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The steps of all segments, one segment after the other.

    The end of a step differs from the start of the next at an impulse, and between two segments.
    """

    grids: Sequence[IntegrationGrid]
    """One for each segment."""
    first_steps: NDArray[np.int64]
    """First step of each segment, then the number of all steps, shape (segments + 1,)."""
    begins_s: Array
    """Start of each step, shape (steps,)."""
    lengths_s: Array
    """Shape (steps,)."""
    starts: Array
    """State at the start of each step, shape (steps, states)."""
    ends: Array
    """Shape (steps, states)."""
    start_rates: Array
    """Derivative of the state by time at the start of each step, shape (steps, states)."""
    end_rates: Array
    """Shape (steps, states)."""

    @property
    def middles_s(self) -> Array:
        """Middle of each step, shape (steps,)."""
        return self.begins_s + self.lengths_s / 2

    def polynomials(self, steps: slice = ALL) -> Array:
        """Return the state inside steps as cubics of the share of the step that has passed, shape (steps, 4, states)."""
        slopes = (self.lengths_s[steps, None] * each[steps] for each in (self.start_rates, self.end_rates))
        return hermite_polynomials(self.starts[steps], self.ends[steps], *slopes)

    @property
    def segments(self) -> Sequence[tuple[int, int]]:
        """First step of each segment, and the one after its last."""
        return list(pairwise(self.first_steps.tolist()))

    def steps_at(self, true_s: Array, firsts: Sequence[int]) -> NDArray[np.int64]:
        """Return the steps in which these times lie; `firsts`: first of them in each segment.

        Before its segment a time belongs to the first step, after it to the last.
        """
        times_s = np.split(true_s, firsts[1:])
        located = [
            first + np.clip(np.searchsorted(grid.nodes_s, inside_s, side="right") - 1, 0, last - first - 1)
            for grid, inside_s, (first, last) in zip(self.grids, times_s, self.segments, strict=True)
        ]
        return np.concatenate(located)


def integrate(
    compiled: CompiledModel, initials: Array, p: Array, bounds_s: Sequence[tuple[float, float]]
) -> Trajectory:
    """Integrate from initial states (segments, z), each between two recorded times since the first sample."""
    times, times_by = (each.full() for each in compiled.discontinuities(p))
    discontinuities, step_s, grids = Times(times[:, 0], times_by), compiled.step_s(p), []
    for recorded_s in map(np.array, bounds_s):
        bounds = Times(compiled.true_time([recorded_s], p)[:, 0], compiled.true_time.jacobian([recorded_s], p)[:, 0])
        grids.append(make_grid(bounds, discontinuities, compiled.impulses, step_s))
    pieces = [_integrate_segment(compiled, initial, p, grid) for initial, grid in zip(initials, grids, strict=True)]
    first_steps = np.cumsum([0, *(len(grid.steps_s) for grid in grids)])
    begins_s = np.concatenate([grid.nodes_s[:-1] for grid in grids])
    lengths_s = np.concatenate([grid.steps_s for grid in grids])
    starts, ends = (np.concatenate(each) for each in zip(*pieces, strict=True))
    middles_s = begins_s + lengths_s / 2
    start_rates = compiled.rate([starts.T, begins_s, middles_s], p)
    end_rates = compiled.rate([ends.T, begins_s + lengths_s, middles_s], p)
    return Trajectory(grids, first_steps, begins_s, lengths_s, starts, ends, start_rates, end_rates)


def hermite_polynomials(start: Array, end: Array, slope: Array, end_slope: Array) -> Array:
    """Return the coefficients of cubics between 0 and 1 by values and slopes at both ends, shape (n, 4, ...), constants first."""
    polynomials = np.empty((len(start), 4, *start.shape[1:]))
    polynomials[:, 0], polynomials[:, 1] = start, slope
    rise = end - start
    cubic = np.subtract(slope + end_slope, 2 * rise, out=polynomials[:, 3])
    np.subtract(rise - slope, cubic, out=polynomials[:, 2])
    return polynomials


def _integrate_segment(compiled: CompiledModel, initial: Array, p: Array, grid: IntegrationGrid) -> tuple[Array, Array]:
    """Return the states at the starts and at the ends of the steps."""
    state = compiled.state(initial)[0].full()[:, 0]
    steps = len(grid.steps_s)
    starts, ends = np.empty((steps, len(state))), np.empty((steps, len(state)))
    for first, last in pairwise(sorted({0, *grid.impulses, steps})):
        if first in grid.impulses:
            state = compiled.impulses[grid.impulses[first]](state, grid.nodes_s[first], p)[0].full()[:, 0]
        ends[first:last] = compiled.steps(state, grid.nodes_s[first:last], grid.steps_s[first:last], p)
        starts[first], starts[first + 1 : last] = state, ends[first : last - 1]
        state = ends[last - 1]
    return starts, ends
