"""The spherical pendulum as the housing sees it: equations of motion, integration, specific force.

All quantities are components in the housing's frame. A horizontal pair (x, y) is one complex number x + iy. The state is

    q   direction of gravity, by twice its stereographic coordinate      w   rate of the rope's direction n = -z, in 1/s
    p   side pull per weight, in level axes

With the unit vector of gravity (u, u_z), q = 2 u/(1 - u_z): nearly u in a small swing, and |q| = 2 tan(angle/2) in any. A
stereographic coordinate is singular at one point of the sphere only, here the load straight above the pivot. The pull is
horizontal; its axes are those of the housing, turned by the least rotation that makes them level, so its size is |p| and its
component across the rope is l = p - Re(conj(p) u) q/2. With k = g/L, the viscous damping rate c, the drag coefficient d (drag
force per mass = d |v| v/L) and the angle h at which dry friction holds the rope, kinematics (parallel transport of the
housing's axes is part of it, so no frame has to be carried along; Tsiotras and Longuski 1995) and Newton's law read

    q' = -w - conj(w) q^2/4      p' = -i Im(conj(w) q)/2 p      w' = k (u + l) - (c + d |w| + h k/|w| + 2 L'/L) w
    u = q/(1 + |q|^2/4)          u_z = -(1 - |q|^2/4)/(1 + |q|^2/4)

A housing that spins about the rope adds -i s to the rate of each of q, w and p. An accelerometer at the distance r from the
pivot reads, in units of g,

    f_x + i f_y = (r a + 2 r' w - (w . e) w)/g - u      f_z = (r |w|^2 - r'' + a . e)/g - u_z

where a is the right-hand side of w' without the spin, and e = e_x + i e_y the place of the accelerometer beside the rope.

The physics is that of `devices.pendulum.pendulum` in other coordinates; a test compares the two.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

ComplexArray = NDArray[np.complex128]
ComplexValue = complex | NDArray[Any]
"""One motion in Python's own numbers, which cost a tenth of arrays of one element, or arrays of many motions."""
State = tuple[ComplexValue, ComplexValue, ComplexValue]
"""q, w in 1/s, p."""
SMOOTH_FRICTION_RAD = 0.004
"""Amplitude of a swing whose rate is that below which dry friction falls with the rate. Basis: a jump within one step of the
integration would not be integrated; swings as small as this hardly slide."""


@dataclass(frozen=True, slots=True)
class ForceField:
    """Coefficients of the equations; each of shape (...,) that broadcasts against the motions, or a scalar."""

    stiffness_1_s2: Array | float
    """k = g/L."""
    damping_1_s: Array | float
    """c, the drag of the load per mass and speed."""
    drag: Array | float | None = None
    """d, the coefficient of drag that grows with the square of the speed; None: there is none."""
    spin_1_s: Array | float | None = None
    """s, the rate at which the housing turns about the rope; None: it does not turn."""
    lengthening_1_s: Array | float | None = None
    """L'/L; None: the rope keeps its length."""
    friction: Array | float | None = None
    """h, the angle in rad at which dry friction holds the rope; None: there is none."""

    def at(self, _half_step: int) -> "ForceField":
        """Return the coefficients at a half step of an integration: they are constant."""
        return self

    def unperturbed(self) -> "ForceField":
        """Return the coefficients of the first variant, the last dimension being the variants."""
        return ForceField(
            _first(self.stiffness_1_s2),
            _first(self.damping_1_s),
            None if self.drag is None else _first(self.drag),
            None if self.spin_1_s is None else _first(self.spin_1_s),
            None if self.lengthening_1_s is None else _first(self.lengthening_1_s),
            None if self.friction is None else _first(self.friction),
        )


def _first(variants: Array | float) -> Array:
    first: Array = np.asarray(variants)[..., 0]
    return first


@dataclass(frozen=True, slots=True)
class TrajectoryInput:
    """Coefficients while the rope's length changes; the first dimension is the half steps of an integration."""

    stiffness_1_s2: Array
    damping_1_s: Array | float
    lengthening_1_s: Array

    def at(self, half_step: int) -> ForceField:
        """Return the coefficients at a half step."""
        return ForceField(
            self.stiffness_1_s2[half_step], self.damping_1_s, lengthening_1_s=self.lengthening_1_s[half_step]
        )


@dataclass(frozen=True, slots=True)
class SensorPlacement:
    """Distance of the accelerometer from the pivot over g, with its derivatives; each of shape (n, ...) or a scalar."""

    distance_s2: Array | float
    """r/g."""
    velocity_s: Array | float = 0.0
    """r'/g."""
    acceleration: Array | float = 0.0
    """r''/g."""
    beside_s2: complex = 0j
    """e/g."""


@dataclass(frozen=True, slots=True)
class SwingTrajectory:
    """Integrated motions on a uniform grid of steps."""

    state: ComplexArray
    """Shape (steps + 1, 3, ...): rows are q, w in 1/s, p."""
    rate: ComplexArray
    """Time derivative of the state, of the same shape."""
    step_s: float


def gravity_components(q: ComplexValue) -> tuple[ComplexValue, float | Array]:
    """Return u, the components of gravity's unit vector across the rope, and u_z, which is negative while the rope hangs."""
    share = 0.25 * _square(q)
    per = 1 / (1 + share)
    return per * q, per * (share - 1)


def rope_angle(q: ComplexValue) -> Array:
    """Return the angle of the rope from the vertical, 0 to pi."""
    angle_rad: Array = 2 * np.arctan(0.5 * np.abs(q))
    return angle_rad


def equilibrium(pull: ComplexArray) -> ComplexArray:
    """Return q of a rope at rest under a side pull: the rope is along gravity and pull together."""
    q: ComplexArray = -2 / (1 + np.sqrt(1 + _square(pull))) * pull
    return q


def transverse_acceleration(q: ComplexValue, w: ComplexValue, pull: ComplexValue, field: ForceField) -> ComplexValue:
    """Return n'' across the rope in 1/s^2, the right-hand side of w'."""
    u, _ = gravity_components(q)
    damping = field.damping_1_s
    if field.drag is not None:
        damping = damping + field.drag * np.abs(w)
    if field.friction is not None:
        stiffness = field.stiffness_1_s2
        damping = damping + field.friction * stiffness / np.sqrt(_square(w) + SMOOTH_FRICTION_RAD**2 * stiffness)
    if field.lengthening_1_s is not None:
        damping = damping + 2 * field.lengthening_1_s
    across = pull - 0.5 * _dot(pull, u) * q
    acceleration: ComplexValue = field.stiffness_1_s2 * (u + across) - damping * w
    return acceleration


def _square(value: ComplexValue) -> Array | float:
    squared: Array | float = value.real * value.real + value.imag * value.imag
    return squared


def state_rate(state: State, field: ForceField) -> State:
    """Return the time derivatives of q, w and p."""
    q, w, pull = state
    across = w.conjugate() * q
    q_rate, w_rate = -w - 0.25 * across * q, transverse_acceleration(q, w, pull, field)
    turn = -0.5j * across.imag
    if field.spin_1_s is None:
        return q_rate, w_rate, turn * pull
    spin = 1j * field.spin_1_s
    return q_rate - spin * q, w_rate - spin * w, (turn - spin) * pull


def integrate(state: ComplexArray, field: ForceField | TrajectoryInput, step_s: float, steps: int) -> SwingTrajectory:
    """Integrate states of shape (3, ...) by classical fourth-order Runge-Kutta steps."""
    states = np.empty((steps + 1, *state.shape), dtype=np.complex128)
    rates = np.empty_like(states)
    k2, k3, k4 = np.empty((3, *state.shape), dtype=np.complex128)
    half_s = step_s / 2
    states[0] = state
    with np.errstate(invalid="ignore", over="ignore"):
        for i in range(steps):
            begin, middle, end = field.at(2 * i), field.at(2 * i + 1), field.at(2 * i + 2)
            state, k1 = states[i], rates[i]
            k1[0], k1[1], k1[2] = state_rate(tuple(state), begin)
            k2[0], k2[1], k2[2] = state_rate(tuple(state + half_s * k1), middle)
            k3[0], k3[1], k3[2] = state_rate(tuple(state + half_s * k2), middle)
            k4[0], k4[1], k4[2] = state_rate(tuple(state + step_s * k3), end)
            np.add(state, step_s / 6 * (k1 + k4 + 2 * (k2 + k3)), out=states[i + 1])
        rates[steps, 0], rates[steps, 1], rates[steps, 2] = state_rate(tuple(states[steps]), field.at(2 * steps))
    return SwingTrajectory(states, rates, step_s)


def propagate(state: State, field: ForceField | TrajectoryInput, step_s: float, steps: int) -> list[State]:
    """Integrate one motion in Python's own numbers, by the same steps; return `steps + 1` states."""
    states = [state]
    half_s = step_s / 2
    with np.errstate(invalid="ignore", over="ignore"):
        for i in range(steps):
            begin, middle, end = field.at(2 * i), field.at(2 * i + 1), field.at(2 * i + 2)
            k1 = state_rate(state, begin)
            k2 = state_rate(_step(state, k1, half_s), middle)
            k3 = state_rate(_step(state, k2, half_s), middle)
            k4 = state_rate(_step(state, k3, step_s), end)
            mean = [(a + d + 2 * (b + c)) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
            state = _step(state, (mean[0], mean[1], mean[2]), step_s)
            states.append(state)
    return states


def _step(state: State, rate: State, time_s: float) -> State:
    (q, w, pull), (q_rate, w_rate, pull_rate) = state, rate
    return q + time_s * q_rate, w + time_s * w_rate, pull + time_s * pull_rate


def interpolate(
    trajectory: SwingTrajectory, step: NDArray[np.intp], fraction: Array, segment: NDArray[np.intp]
) -> ComplexArray:
    """Return states between the steps by cubic Hermite interpolation, shape (n, 3, ...).

    `step` and `fraction` of a step give the time, `segment` the entry of the motions' first dimension; all of shape (n,).
    """
    s = fraction.reshape(-1, *[1] * (trajectory.state.ndim - 2))
    weight_after = s * s * (3 - 2 * s)
    start, end = trajectory.state[step, :, segment], trajectory.state[step + 1, :, segment]
    start_rate, end_rate = trajectory.rate[step, :, segment], trajectory.rate[step + 1, :, segment]
    slope = (start_rate * (1 - s) - end_rate * s) * (s * (1 - s) * trajectory.step_s)
    mixed: ComplexArray = start + weight_after * (end - start) + slope
    return mixed


def position_jacobian(state: ComplexArray, field: ForceField) -> Array:
    """Return the derivative of the reading by r/g, e_x/g and e_y/g, shape (n, 3, 3) for states of shape (n, 3)."""
    w = state[:, 1]
    across = transverse_acceleration(state[:, 0], w, state[:, 2], field)
    by_distance = np.stack([across.real, across.imag, _square(w)], axis=1)
    by_x = np.stack([-w.real * w.real, -w.real * w.imag, across.real], axis=1)
    by_y = np.stack([-w.imag * w.real, -w.imag * w.imag, across.imag], axis=1)
    return np.stack([by_distance, by_x, by_y], axis=2)


def specific_force_g(state: ComplexArray, field: ForceField, place: SensorPlacement) -> Array:
    """Return the reading of an ideal accelerometer, shape (n, 3, ...) for states of shape (n, 3, ...)."""
    q, w, pull = state[:, 0], state[:, 1], state[:, 2]
    acceleration = transverse_acceleration(q, w, pull, field)
    u, u_z = gravity_components(q)
    across = place.distance_s2 * acceleration + 2 * place.velocity_s * w - u
    along = place.distance_s2 * _square(w) - place.acceleration - u_z
    if place.beside_s2 != 0:
        across = across - _dot(w, place.beside_s2) * w
        along = along + _dot(acceleration, place.beside_s2)
    return np.stack([across.real, across.imag, along], axis=1)


def _dot(a: ComplexValue, b: ComplexValue) -> Array | float:
    product: Array | float = a.real * b.real + a.imag * b.imag
    return product
