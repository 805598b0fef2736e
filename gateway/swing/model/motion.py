"""A motion over a window: its state at the start of every segment, and the parameters that it follows."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import small_swing_period_s
from gateway.swing.model.rope_spline import Rope, SplineGrid
from gateway.swing.model.spherical_pendulum import Complex, ForceField, Real, State, TrajectoryInput, propagate

STATES = 6
"""u_x, u_y, w_x/w0, w_y/w0, l_x, l_y: a state, free of dimension."""
LN_LENGTH, DAMPING, DRAG, SPIN = range(4)
"""Places in a motion's parameters; a short vector of parameters has the first two only: no drag, no spin.

While the rope's length changes the first two are followed by the speeds of a raster instead.
"""
PLAIN, FULL = 2, 4
STEPS_PER_PERIOD = 36
STEPS_PER_SEGMENT = 2
COARSE = 2
"""Steps in one where a motion is only carried on to start from."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Where the segments lie."""

    start_s: float
    step_s: float
    segments: int
    rate_1_s: float
    """w0: a nominal angular frequency that makes states free of dimension."""

    @classmethod
    def over(cls, start_s: float, end_s: float, period_s: float) -> "Grid":
        """A grid that covers [start, end] with the step that the period asks for."""
        step_s = period_s / STEPS_PER_PERIOD
        segments = max(1, int(np.ceil((end_s - start_s) / (step_s * STEPS_PER_SEGMENT))))
        return cls(start_s, step_s, segments, 2 * np.pi / period_s)

    @property
    def segment_s(self) -> float:
        """How long one segment is."""
        return STEPS_PER_SEGMENT * self.step_s

    @property
    def end_s(self) -> float:
        """Where the last segment ends."""
        return self.start_s + self.segments * self.segment_s

    @property
    def starts_s(self) -> Real:
        """When each segment begins."""
        return np.asarray(self.start_s + self.segment_s * np.arange(self.segments), dtype=np.float64)

    def locate(self, time_s: Real) -> "Instants":
        """Where times, shape (n,), lie; those outside the grid are taken for its nearer end."""
        position = np.clip((time_s - self.start_s) / self.step_s, 0.0, self.segments * STEPS_PER_SEGMENT - 1e-9)
        whole = position.astype(np.intp)
        segment = whole // STEPS_PER_SEGMENT
        return Instants(time_s, segment, whole - STEPS_PER_SEGMENT * segment, position - whole)


@dataclass(frozen=True, slots=True)
class Instants:
    """Times on a grid, each of shape (n,)."""

    time_s: Real
    segment: NDArray[np.intp]
    step: NDArray[np.intp]
    """In the segment."""
    fraction: Real
    """Of the step."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion on a grid."""

    grid: Grid
    nodes: Complex
    """States at the segments' starts, shape (3, segments): u, w in 1/s, l."""
    parameters: Real
    """ln(L/m), damping ratio and, where they are reckoned with, drag and spin in 1/s: shape (PLAIN,) or (FULL,).

    With a raster: ln(L/m) before it, damping ratio on that length, speeds in m/s: shape (PLAIN + raster.count,).
    """
    gravity_m_s2: float
    raster: SplineGrid | None = None
    """None: the rope keeps its length."""

    @property
    def length_m(self) -> float:
        """Rope length, at the end where it changes."""
        if self.raster is None:
            return float(np.exp(self.parameters[LN_LENGTH]))
        return float(self.rope(np.array([self.grid.end_s])).length_m[0])

    @property
    def damping_ratio(self) -> float:
        """Of a small swing."""
        return float(self.parameters[DAMPING])

    def rope(self, time_s: Real) -> Rope:
        """The rope at times of any shape; constant without a raster."""
        length_m = np.exp(self.parameters[LN_LENGTH])
        if self.raster is None:
            still = np.zeros(1)
            return Rope(length_m, still, still)
        return self.raster.rope(time_s, length_m, self.parameters[PLAIN:])

    @property
    def damping_1_s(self) -> float:
        """Rate at which drag slows the load: the damping ratio is of the rope before it moves."""
        return float(field_of(self.parameters[:PLAIN], self.gravity_m_s2).damping_1_s)

    def course(self, start_s: float, step_s: float, steps: int) -> ForceField | TrajectoryInput:
        """What the motion follows from a time on."""
        if self.raster is None:
            return field_of(self.parameters, self.gravity_m_s2)
        rope = self.rope(np.asarray(start_s + step_s / 2 * np.arange(2 * steps + 1), dtype=np.float64))
        return TrajectoryInput(self.gravity_m_s2 / rope.length_m, self.damping_1_s, rope.rate_m_s / rope.length_m)

    def propagated(self, state: Complex, from_s: float, step_s: float, steps: int) -> Complex:
        """A state of shape (3,) integrated onward: (steps + 1, 3)."""
        first: State = complex(state[0]), complex(state[1]), complex(state[2])
        return np.array(propagate(first, self.course(from_s, step_s, steps), step_s, steps))

    @property
    def period_s(self) -> float:
        """Of a small swing."""
        return small_swing_period_s(self.length_m, self.gravity_m_s2)

    @property
    def unit(self) -> Real:
        """What a state is divided by to be free of dimension, shape (3, 1)."""
        return np.array([[1.0], [self.grid.rate_1_s], [1.0]])

    def with_parameters(self, count: int) -> "Motion":
        """With `count` parameters: new ones are zero."""
        kept = self.parameters[:count]
        return replace(self, parameters=np.concatenate([kept, np.zeros(count - len(kept))]))

    def hoisting(self, raster: SplineGrid) -> "Motion":
        """With a raster of speeds: those that it has already, else 0."""
        if self.raster is None:
            return replace(self.with_parameters(PLAIN + raster.count), raster=raster)
        speeds, way_m = self.raster.moved(raster, self.parameters[PLAIN:])
        first = np.exp(self.parameters[LN_LENGTH]) + way_m
        return replace(self, raster=raster, parameters=np.array([np.log(first), self.damping_ratio, *speeds]))

    def with_constant_length(self) -> "Motion":
        """On a rope that keeps the length that it has at the end."""
        if self.raster is None:
            return self
        return replace(self, raster=None, parameters=np.array([np.log(self.length_m), self.damping_ratio]))

    def extended(self, start_s: float, end_s: float) -> "Motion":
        """On a new grid over [start, end], where `start` lies in the old one: the nodes are integrated onward."""
        grid = Grid.over(start_s, end_s, self.period_s)
        segment = int(self.grid.locate(np.array([start_s])).segment[0])
        at_s = self.grid.start_s + segment * self.grid.segment_s
        state = self.nodes[:, segment]
        if start_s > at_s:
            state = self.propagated(state, at_s, (start_s - at_s) / STEPS_PER_SEGMENT, STEPS_PER_SEGMENT)[-1]
        coarse = STEPS_PER_SEGMENT // COARSE
        path = self.propagated(state, start_s, COARSE * grid.step_s, coarse * (grid.segments - 1))
        return replace(self, grid=grid, nodes=path[::coarse].T)

    def extended_backward(self, start_s: float, end_s: float) -> "Motion":
        """On a new grid over [start, end], where `start` lies before the old one: integrated backward, then onward."""
        steps = max(1, int(np.ceil((self.grid.start_s - start_s) / self.grid.step_s)))
        back_s = (start_s - self.grid.start_s) / steps
        first = self.propagated(self.nodes[:, 0], self.grid.start_s, back_s, steps)[-1][:, None]
        return replace(self, grid=Grid.over(start_s, start_s, self.period_s), nodes=first).extended(start_s, end_s)


def field_of(parameters: Real, gravity_m_s2: float) -> ForceField:
    """The field of parameters of shape (count, ...)."""
    stiffness = gravity_m_s2 * np.exp(-parameters[LN_LENGTH])
    damping = 2 * parameters[DAMPING] * np.sqrt(stiffness)
    if len(parameters) == PLAIN:
        return ForceField(stiffness, damping)
    return ForceField(stiffness, damping, parameters[DRAG], parameters[SPIN])
