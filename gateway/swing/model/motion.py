"""A motion over a window: its state at the start of every segment of multiple shooting, and its parameters."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import small_swing_period_s
from gateway.numerics.array import Array
from gateway.swing.model.rope_spline import RopeLengthSpline, SplineGrid
from gateway.swing.model.spherical_pendulum import ComplexArray, ForceField, State, TrajectoryInput, propagate

N_STATES = 6
"""Definition: q_x, q_y, w_x/w0, w_y/w0, p_x, p_y, a state without dimension."""
LN_LENGTH, DAMPING, DRAG, SPIN, FRICTION = range(5)
"""Definition: places in the parameters of a motion. A short vector has the first two alone, without drag, spin and friction;
while the rope's length changes they are followed by the speeds of the splines."""
N_BASE_PARAMETERS = 2
"""Definition: length of a short vector of parameters."""
STEPS_PER_PERIOD = 36
"""Integration steps in the period of a small swing. Basis: the phase error h^5/120 of a fourth-order step adds up to 5e-5 rad in
a period; test against the exact period."""
STEPS_PER_SEGMENT = 2
"""Integration steps in a segment of multiple shooting. Basis: cost; short segments keep each one nearly linear."""
COARSE_STEP_RATIO = 2
"""Step over the fine one where a motion is only propagated to a starting point. Basis: cost; the fit corrects the error."""


@dataclass(frozen=True, slots=True)
class ShootingGrid:
    """Segments of multiple shooting and the integration steps in them."""

    start_s: float
    step_s: float
    segments: int
    rate_1_s: float
    """w0, a nominal angular frequency that makes states dimensionless."""

    @classmethod
    def covering(cls, start_s: float, end_s: float, period_s: float) -> "ShootingGrid":
        """Return a grid that covers [start, end] with steps for a period."""
        step_s = period_s / STEPS_PER_PERIOD
        segments = max(1, int(np.ceil((end_s - start_s) / (step_s * STEPS_PER_SEGMENT))))
        return cls(start_s, step_s, segments, 2 * np.pi / period_s)

    @property
    def period_s(self) -> float:
        """Period that the steps are made for."""
        return 2 * np.pi / self.rate_1_s

    @property
    def segment_s(self) -> float:
        """Duration of a segment."""
        return STEPS_PER_SEGMENT * self.step_s

    @property
    def end_s(self) -> float:
        """End of the last segment."""
        return self.start_s + self.segments * self.segment_s

    @property
    def starts_s(self) -> Array:
        """Start of each segment."""
        return np.asarray(self.start_s + self.segment_s * np.arange(self.segments), dtype=np.float64)

    def locate(self, time_s: Array) -> "GridTimes":
        """Locate times of shape (n,); a time outside the grid is taken for the nearer end."""
        position = np.clip((time_s - self.start_s) / self.step_s, 0.0, self.segments * STEPS_PER_SEGMENT - 1e-9)
        whole = position.astype(np.intp)
        segment = whole // STEPS_PER_SEGMENT
        return GridTimes(time_s, segment, whole - STEPS_PER_SEGMENT * segment, position - whole)


@dataclass(frozen=True, slots=True)
class GridTimes:
    """Times on a shooting grid, each of shape (n,)."""

    time_s: Array
    segment: NDArray[np.intp]
    step: NDArray[np.intp]
    """Step in the segment."""
    fraction: Array
    """Fraction of the step."""


@dataclass(frozen=True, slots=True)
class PendulumMotion:
    """A motion on a shooting grid."""

    grid: ShootingGrid
    nodes: ComplexArray
    """States at the starts of the segments, shape (3, segments): q, w in 1/s, p."""
    parameters: Array
    """ln(L/m), damping ratio and, where they are fitted, drag, spin in 1/s and friction in rad.

    With splines: ln(L/m) before the first, damping ratio on that length, speeds in m/s, shape (N_BASE_PARAMETERS + count,).
    """
    gravity_m_s2: float
    splines: SplineGrid | None = None
    """Splines of the rope's speed; None: the rope keeps its length."""

    @property
    def length_m(self) -> float:
        """Length of the rope, at the end where it changes."""
        if self.splines is None:
            return float(np.exp(self.parameters[LN_LENGTH]))
        return float(self.rope_at(np.array([self.grid.end_s])).length_m[0])

    @property
    def extreme_lengths_m(self) -> tuple[float, float]:
        """Shortest and longest rope on the grid; splines may make the shortest one negative."""
        lengths_m = self.rope_at(np.append(self.grid.starts_s, self.grid.end_s)).length_m
        return float(np.min(lengths_m)), float(np.max(lengths_m))

    @property
    def damping_ratio(self) -> float:
        """Damping ratio of a small swing."""
        return float(self.parameters[DAMPING])

    @property
    def drag(self) -> float | None:
        """Coefficient of quadratic drag; None where it is not fitted."""
        return self._fitted(DRAG)

    @property
    def friction_rad(self) -> float | None:
        """Angle at which dry friction holds the rope; None where it is not fitted."""
        return self._fitted(FRICTION)

    def _fitted(self, place: int) -> float | None:
        is_fitted = self.splines is None and len(self.parameters) > N_BASE_PARAMETERS
        return float(self.parameters[place]) if is_fitted else None

    @property
    def damping_1_s(self) -> float:
        """Viscous damping rate; the damping ratio is that on the rope before its length changes."""
        return float(force_field(self.parameters[:N_BASE_PARAMETERS], self.gravity_m_s2).damping_1_s)

    @property
    def period_s(self) -> float:
        """Period of a small swing."""
        return small_swing_period_s(self.length_m, self.gravity_m_s2)

    @property
    def state_scale(self) -> Array:
        """Divisor that makes a state dimensionless, shape (3, 1)."""
        return np.array([[1.0], [self.grid.rate_1_s], [1.0]])

    def rope_at(self, time_s: Array) -> RopeLengthSpline:
        """Return the rope at times of any shape; constant without splines."""
        length_m = np.exp(self.parameters[LN_LENGTH])
        if self.splines is None:
            zero = np.zeros(1)
            return RopeLengthSpline(length_m, zero, zero)
        return self.splines.evaluate(time_s, length_m, self.parameters[N_BASE_PARAMETERS:])

    def trajectory_input(self, start_s: float, step_s: float, steps: int) -> ForceField | TrajectoryInput:
        """Return the coefficients of the equations from a time on, for an integration."""
        if self.splines is None:
            return force_field(self.parameters, self.gravity_m_s2)
        rope = self.rope_at(np.asarray(start_s + step_s / 2 * np.arange(2 * steps + 1), dtype=np.float64))
        return TrajectoryInput(self.gravity_m_s2 / rope.length_m, self.damping_1_s, rope.rate_m_s / rope.length_m)

    def propagated(self, state: ComplexArray, from_s: float, step_s: float, steps: int) -> ComplexArray:
        """Return a state of shape (3,) integrated by some steps: (steps + 1, 3)."""
        first: State = complex(state[0]), complex(state[1]), complex(state[2])
        return np.array(propagate(first, self.trajectory_input(from_s, step_s, steps), step_s, steps))

    def with_parameters(self, count: int) -> "PendulumMotion":
        """Return the motion with `count` parameters; new ones are zero."""
        kept = self.parameters[:count]
        return replace(self, parameters=np.concatenate([kept, np.zeros(count - len(kept))]))

    def with_splines(self, splines: SplineGrid) -> "PendulumMotion":
        """Return the motion with splines of the rope's speed: the speeds that it already has, zero elsewhere."""
        if self.splines is None:
            return replace(self.with_parameters(N_BASE_PARAMETERS + splines.count), splines=splines)
        speeds, added_m = self.splines.transfer(splines, self.parameters[N_BASE_PARAMETERS:])
        first_m = np.exp(self.parameters[LN_LENGTH]) + added_m
        return replace(self, splines=splines, parameters=np.array([np.log(first_m), self.damping_ratio, *speeds]))

    def extended(self, start_s: float, end_s: float) -> "PendulumMotion":
        """Return the motion on a new grid over [start, end] where `start` lies in the old one; nodes are propagated."""
        grid = ShootingGrid.covering(start_s, end_s, self.period_s)
        segment = int(self.grid.locate(np.array([start_s])).segment[0])
        node_s = self.grid.start_s + segment * self.grid.segment_s
        state = self.nodes[:, segment]
        if start_s > node_s:
            state = self.propagated(state, node_s, (start_s - node_s) / STEPS_PER_SEGMENT, STEPS_PER_SEGMENT)[-1]
        steps = STEPS_PER_SEGMENT // COARSE_STEP_RATIO
        states = self.propagated(state, start_s, COARSE_STEP_RATIO * grid.step_s, steps * (grid.segments - 1))
        return replace(self, grid=grid, nodes=states[::steps].T)

    def extended_backward(self, start_s: float, end_s: float) -> "PendulumMotion":
        """Return the motion on a new grid over [start, end] where `start` lies before the old one."""
        steps = max(1, int(np.ceil((self.grid.start_s - start_s) / self.grid.step_s)))
        back_s = (start_s - self.grid.start_s) / steps
        first = self.propagated(self.nodes[:, 0], self.grid.start_s, back_s, steps)[-1][:, None]
        grid = ShootingGrid.covering(start_s, start_s, self.period_s)
        return replace(self, grid=grid, nodes=first).extended(start_s, end_s)


def force_field(parameters: Array, gravity_m_s2: float) -> ForceField:
    """Return the coefficients of the equations for parameters of shape (count, ...)."""
    stiffness = gravity_m_s2 * np.exp(-parameters[LN_LENGTH])
    damping = 2 * parameters[DAMPING] * np.sqrt(stiffness)
    if len(parameters) == N_BASE_PARAMETERS:
        return ForceField(stiffness, damping)
    return ForceField(stiffness, damping, parameters[DRAG], parameters[SPIN], friction=parameters[FRICTION])
