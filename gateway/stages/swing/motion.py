"""A motion over a window: its state at the start of every segment, and the parameters that it follows."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.stages.swing.hoist import Raster, Rope
from gateway.stages.swing.model import Complex, Course, Field, Real, integrate

STATES = 6
"""u_x, u_y, w_x/w0, w_y/w0, l_x, l_y: a state, free of dimension."""
LN_LENGTH, DAMPING, DRAG, SPIN = range(4)
"""Places in a motion's parameters; a short vector of parameters has the first two only: no drag, no spin.

While the rope's length changes the first two are followed by the speeds of a raster instead.
"""
PLAIN, FULL = 2, 4
STEPS_PER_PERIOD = 36
STEPS_PER_SEGMENT = 6
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

    def locate(self, time_s: Real) -> tuple[NDArray[np.intp], NDArray[np.intp], Real]:
        """Segment, step in it and fraction of the step, for times inside the grid."""
        position = np.clip((time_s - self.start_s) / self.step_s, 0.0, self.segments * STEPS_PER_SEGMENT - 1e-9)
        whole = position.astype(np.intp)
        return whole // STEPS_PER_SEGMENT, whole % STEPS_PER_SEGMENT, position - whole


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
    raster: Raster | None = None
    """None: the rope keeps its length."""

    @property
    def length_m(self) -> float:
        """Rope length, at the end where it changes."""
        if self.raster is None:
            return float(np.exp(self.parameters[LN_LENGTH]))
        return float(self.rope(np.array([self.grid.end_s]), self.parameters).length_m[0])

    @property
    def damping_ratio(self) -> float:
        """Of a small swing."""
        return float(self.parameters[DAMPING])

    def rope(self, time_s: Real, parameters: Real) -> Rope:
        """The rope at times of any shape under parameters of shape (count, ...); constant without a raster."""
        length_m = np.exp(parameters[LN_LENGTH])
        if self.raster is None:
            still = np.zeros(1)
            return Rope(length_m, still, still)
        return self.raster.rope(time_s, length_m, parameters[PLAIN:])

    def field_at(self, time_s: Real, parameters: Real) -> Field:
        """What the motion follows at times, under parameters of shape (count, ...)."""
        if self.raster is None:
            return field_of(parameters, self.gravity_m_s2)
        rope = self.rope(time_s, parameters)
        return Field(
            self.gravity_m_s2 / rope.length_m,
            field_of(parameters[:PLAIN], self.gravity_m_s2).damping_1_s,
            lengthening_1_s=rope.rate_m_s / rope.length_m,
        )

    def course(self, start_s: Real, step_s: float, steps: int, parameters: Real) -> Field | Course:
        """What integrations from times, shape (n,), follow under parameters of shape (count, lanes)."""
        if self.raster is None:
            return field_of(parameters, self.gravity_m_s2)
        time_s = start_s + step_s / 2 * np.arange(2 * steps + 1)[:, None]
        rope = self.rope(time_s, parameters)
        damping_1_s = np.asarray(field_of(parameters[:PLAIN], self.gravity_m_s2).damping_1_s)
        return Course(self.gravity_m_s2 / rope.length_m, damping_1_s, rope.rate_m_s / rope.length_m)

    def carried(self, state: Complex, from_s: float, step_s: float, steps: int) -> Complex:
        """States of shape (3, 1) integrated onward: (steps + 1, 3)."""
        course = self.course(np.array([from_s]), step_s, steps, self.parameters[:, None])
        return integrate(state[..., None], course, step_s, steps).state[..., 0, 0]

    @property
    def period_s(self) -> float:
        """Of a small swing."""
        return float(2 * np.pi * np.sqrt(self.length_m / self.gravity_m_s2))

    @property
    def unit(self) -> Real:
        """What a state is divided by to be free of dimension, shape (3, 1)."""
        return np.array([[1.0], [self.grid.rate_1_s], [1.0]])

    def with_parameters(self, count: int) -> "Motion":
        """With `count` parameters: new ones are zero."""
        kept = self.parameters[:count]
        return replace(self, parameters=np.concatenate([kept, np.zeros(count - len(kept))]))

    def hoisting(self, raster: Raster) -> "Motion":
        """With a raster of speeds: those that it has already, else 0."""
        if self.raster is None:
            return replace(self.with_parameters(PLAIN + raster.count), raster=raster)
        speeds, way_m = self.raster.moved(raster, self.parameters[PLAIN:])
        first = np.exp(self.parameters[LN_LENGTH]) + way_m
        return replace(self, raster=raster, parameters=np.array([np.log(first), self.damping_ratio, *speeds]))

    def settled(self) -> "Motion":
        """On a rope that keeps the length that it has at the end."""
        if self.raster is None:
            return self
        return replace(self, raster=None, parameters=np.array([np.log(self.length_m), self.damping_ratio]))

    def extended(self, start_s: float, end_s: float) -> "Motion":
        """On a new grid over [start, end], where `start` lies in the old one: the nodes are integrated onward."""
        grid = Grid.over(start_s, end_s, self.period_s)
        segment, _, _ = self.grid.locate(np.array([start_s]))
        at_s = self.grid.start_s + float(segment[0]) * self.grid.segment_s
        state = self.nodes[:, segment]
        if start_s > at_s:
            state = self.carried(state, at_s, (start_s - at_s) / STEPS_PER_SEGMENT, STEPS_PER_SEGMENT)[-1][:, None]
        coarse = STEPS_PER_SEGMENT // COARSE
        path = self.carried(state, start_s, COARSE * grid.step_s, coarse * (grid.segments - 1))
        return replace(self, grid=grid, nodes=path[::coarse].T)

    def reaching_back(self, start_s: float, end_s: float) -> "Motion":
        """On a new grid over [start, end], where `start` lies before the old one: integrated backward, then onward."""
        steps = max(1, int(np.ceil((self.grid.start_s - start_s) / self.grid.step_s)))
        back_s = (start_s - self.grid.start_s) / steps
        first = self.carried(self.nodes[:, :1], self.grid.start_s, back_s, steps)[-1][:, None]
        return replace(self, grid=Grid.over(start_s, start_s, self.period_s), nodes=first).extended(start_s, end_s)


def field_of(parameters: Real, gravity_m_s2: float) -> Field:
    """The field of parameters of shape (count, ...)."""
    stiffness = gravity_m_s2 * np.exp(-parameters[LN_LENGTH])
    damping = 2 * parameters[DAMPING] * np.sqrt(stiffness)
    if len(parameters) == PLAIN:
        return Field(stiffness, damping)
    return Field(stiffness, damping, parameters[DRAG], parameters[SPIN])
