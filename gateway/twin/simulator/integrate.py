"""Integration of the motion over segments, each from its own initial state."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.simulator.compiled_model import CompiledModel
from gateway.twin.simulator.integration_grid import IntegrationGrid, Times, make_grid

Array = NDArray[np.float64]
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
    compiled: CompiledModel,
    initials: Array,
    p: Array,
    bounds_s: Sequence[tuple[float, float]],
) -> Trajectory:
    """Integrate from initial states (segments, z), each between two recorded times since the first sample."""
    grids = [_grid(compiled, p, *bounds) for bounds in bounds_s]
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


def _grid(compiled: CompiledModel, p: Array, from_s: float, until_s: float) -> IntegrationGrid:
    recorded = [np.array([from_s, until_s])]
    bounds = Times(compiled.true_time(recorded, p)[:, 0], compiled.true_time_by_p(recorded, p)[:, 0])
    times, times_by = (each.full() for each in compiled.discontinuities(p))
    step_s = compiled.step_s(p)
    return make_grid(bounds, Times(times[:, 0], times_by), compiled.impulses, step_s)
