"""A motion over a window: its state at the start of every segment, and the parameters that it follows."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.stages.swing.model import Complex, Field, Real, integrate

STATES = 6
"""u_x, u_y, w_x/w0, w_y/w0, l_x, l_y: a state, free of dimension."""
LN_LENGTH, DAMPING, DRAG, SPIN = range(4)
"""Places in a motion's parameters; a short vector of parameters has the first two only: no drag, no spin."""
PLAIN, FULL = 2, 4
STEPS_PER_PERIOD = 36
STEPS_PER_SEGMENT = 9


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
    """ln(L/m), damping ratio and, where they are reckoned with, drag and spin in 1/s: shape (PLAIN,) or (FULL,)."""
    gravity_m_s2: float

    @property
    def length_m(self) -> float:
        """Rope length."""
        return float(np.exp(self.parameters[LN_LENGTH]))

    @property
    def damping_ratio(self) -> float:
        """Of a small swing."""
        return float(self.parameters[DAMPING])

    @property
    def field(self) -> Field:
        """What the motion follows."""
        return field_of(self.parameters, self.gravity_m_s2)

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

    def extended(self, start_s: float, end_s: float) -> "Motion":
        """On a new grid over [start, end], where `start` lies in the old one: the nodes are integrated onward."""
        grid = Grid.over(start_s, end_s, self.period_s)
        segment, _, _ = self.grid.locate(np.array([start_s]))
        at_s = self.grid.start_s + float(segment[0]) * self.grid.segment_s
        state = self.nodes[:, segment]
        if start_s > at_s:
            state = integrate(state, self.field, (start_s - at_s) / STEPS_PER_SEGMENT, STEPS_PER_SEGMENT).state[-1]
        path = integrate(state, self.field, grid.step_s, STEPS_PER_SEGMENT * (grid.segments - 1))
        return replace(self, grid=grid, nodes=path.state[::STEPS_PER_SEGMENT, :, 0].T)


def field_of(parameters: Real, gravity_m_s2: float) -> Field:
    """The field of parameters of shape (count, ...)."""
    stiffness = gravity_m_s2 * np.exp(-parameters[LN_LENGTH])
    damping = 2 * parameters[DAMPING] * np.sqrt(stiffness)
    if len(parameters) == PLAIN:
        return Field(stiffness, damping)
    return Field(stiffness, damping, parameters[DRAG], parameters[SPIN])
