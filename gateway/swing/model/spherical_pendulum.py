"""The spherical pendulum as the housing sees it: equations of motion, integration, specific force.

Everything is written in the housing's frame; a horizontal pair (x, y) is one complex number x + iy. With u the unit vector of
gravity, w the rate of the rope's direction n (n = -z of the housing), l the steady side pull per weight (a force constant in
the world), k = g/L, the viscous rate c and the drag coefficient q (drag force per mass = q |v| v/L), Newton's law becomes

    u' = u_z w      l' = l_z w      w' = k (u + l) - (c + q |w| + 2 L'/L) w
    u_z = -sqrt(1 - |u|^2)          l_z = -Re(conj(l) u)/u_z        (the pull is horizontal: l . u = 0)

free of singularities below 90 degrees and without a frame to carry along: parallel transport is in it. A housing that spins
about the rope adds -i s to the rate of each of u, l, w. One at the distance r from the pivot reads, in units of g,

    f_x + i f_y = (r a + 2 r' w)/g - u      f_z = (r |w|^2 - r'')/g - u_z

with a the right-hand side of w' without the spin.

The physics is that of `devices.pendulum.pendulum` in other coordinates; a test holds the two together.
"""

from dataclasses import dataclass
from math import nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Numbers = complex | NDArray[Any]
"""One motion's in Python's own numbers (a tenth of the cost of arrays of one), or many motions' complex arrays."""
State = tuple[Numbers, Numbers, Numbers]
"""u, w in 1/s, l."""


@dataclass(frozen=True, slots=True)
class ForceField:
    """What the motion follows; each of shape (...,) that broadcasts against the motions, or a scalar."""

    stiffness_1_s2: Real | float
    """k = g/L."""
    damping_1_s: Real | float
    """c: the load's drag per mass and speed."""
    drag: Real | float | None = None
    """q: drag that grows with the square of the speed; None: there is none."""
    spin_1_s: Real | float | None = None
    """s: the housing's turning about the rope; None: it does not turn."""
    lengthening_1_s: Real | float | None = None
    """L'/L; None: the rope keeps its length."""

    def at(self, _half_step: int) -> "ForceField":
        """The same at every half step of an integration."""
        return self

    def unperturbed(self) -> "ForceField":
        """The first lane."""
        return ForceField(
            _first(self.stiffness_1_s2),
            _first(self.damping_1_s),
            None if self.drag is None else _first(self.drag),
            None if self.spin_1_s is None else _first(self.spin_1_s),
            None if self.lengthening_1_s is None else _first(self.lengthening_1_s),
        )


def _first(lanes: Real | float) -> Real:
    first: Real = np.asarray(lanes)[..., 0]
    return first


@dataclass(frozen=True, slots=True)
class TrajectoryInput:
    """What the motion follows while the rope's length changes: the first dimension is the half steps of an integration."""

    stiffness_1_s2: Real
    damping_1_s: Real | float
    lengthening_1_s: Real

    def at(self, half_step: int) -> ForceField:
        """At a half step."""
        return ForceField(
            self.stiffness_1_s2[half_step], self.damping_1_s, lengthening_1_s=self.lengthening_1_s[half_step]
        )


@dataclass(frozen=True, slots=True)
class SensorPlacement:
    """Where the housing is on the rope, each of shape (n, ...) or a scalar, in units of g."""

    reach_s2: Real | float
    """r/g."""
    rate_s: Real | float = 0.0
    """r'/g."""
    acceleration: Real | float = 0.0
    """r''/g."""


@dataclass(frozen=True, slots=True)
class Path:
    """Integrated motions on a uniform grid of steps."""

    state: Complex
    """Shape (steps + 1, 3, ...): rows are u, w in 1/s, l."""
    rate: Complex
    """Its time derivative, same shape."""
    step_s: float


def vertical(u: Numbers) -> float | Real:
    """u_z, negative: the rope hangs. NaN where the motion has left the model (90 degrees)."""
    squared: float | Real = 1.0 - (u.real * u.real + u.imag * u.imag)
    if isinstance(squared, float):
        return -sqrt(squared) if squared > 0 else nan
    u_z: Real = -np.sqrt(squared)
    return u_z


def transverse_acceleration(u: Numbers, w: Numbers, pull: Numbers, field: ForceField) -> Numbers:
    """n'' across the rope in 1/s^2: the right-hand side of w'."""
    damping = field.damping_1_s
    if field.drag is not None:
        damping = damping + field.drag * np.abs(w)
    if field.lengthening_1_s is not None:
        damping = damping + 2 * field.lengthening_1_s
    acceleration: Numbers = field.stiffness_1_s2 * (u + pull) - damping * w
    return acceleration


def state_rate(state: State, field: ForceField) -> State:
    """Time derivatives of u, w and l."""
    u, w, pull = state
    u_z = vertical(u)
    by_u, by_w = u_z * w, transverse_acceleration(u, w, pull, field)
    by_pull = (pull.real * u.real + pull.imag * u.imag) / -u_z * w
    if field.spin_1_s is None:
        return by_u, by_w, by_pull
    turn = 1j * field.spin_1_s
    return by_u - turn * u, by_w - turn * w, by_pull - turn * pull


def integrate(state: Complex, field: ForceField | TrajectoryInput, step_s: float, steps: int) -> Path:
    """Carry states of shape (3, ...) on by `steps` classical fourth-order Runge-Kutta steps; NaN beyond 90 degrees."""
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
    return Path(states, rates, step_s)


def propagate(state: State, field: ForceField | TrajectoryInput, step_s: float, steps: int) -> list[State]:
    """The same of one motion, in Python's numbers: `steps + 1` states."""
    path = [state]
    half_s = step_s / 2
    with np.errstate(invalid="ignore", over="ignore"):
        for i in range(steps):
            begin, middle, end = field.at(2 * i), field.at(2 * i + 1), field.at(2 * i + 2)
            k1 = state_rate(state, begin)
            k2 = state_rate(_after(state, k1, half_s), middle)
            k3 = state_rate(_after(state, k2, half_s), middle)
            k4 = state_rate(_after(state, k3, step_s), end)
            mean = [(a + d + 2 * (b + c)) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
            state = _after(state, (mean[0], mean[1], mean[2]), step_s)
            path.append(state)
    return path


def _after(state: State, rate: State, time_s: float) -> State:
    (u, w, pull), (by_u, by_w, by_pull) = state, rate
    return u + time_s * by_u, w + time_s * by_w, pull + time_s * by_pull


def sample(path: Path, step: NDArray[np.intp], fraction: Real, lane: NDArray[np.intp]) -> Complex:
    """States between the steps by cubic Hermite interpolation, shape (n, 3, ...).

    `step` and `fraction` of a step say when, `lane` picks one entry of the motions' first dimension (a segment) for each;
    all of shape (n,).
    """
    s = fraction.reshape(-1, *[1] * (path.state.ndim - 2))
    weight_after = s * s * (3 - 2 * s)
    start, end = path.state[step, :, lane], path.state[step + 1, :, lane]
    slope = (path.rate[step, :, lane] * (1 - s) - path.rate[step + 1, :, lane] * s) * (s * (1 - s) * path.step_s)
    mixed: Complex = start + weight_after * (end - start) + slope
    return mixed


def position_jacobian(state: Complex, field: ForceField) -> Real:
    """Derivative of what the housing reads by r/g, shape (n, 3, ...) for states of shape (n, 3, ...)."""
    w = state[:, 1]
    across = transverse_acceleration(state[:, 0], w, state[:, 2], field)
    return np.stack([across.real, across.imag, w.real * w.real + w.imag * w.imag], axis=1)


def specific_force_g(state: Complex, field: ForceField, place: SensorPlacement) -> Real:
    """What the housing reads, shape (n, 3, ...) for states of shape (n, 3, ...)."""
    u, w, pull = state[:, 0], state[:, 1], state[:, 2]
    across = place.reach_s2 * transverse_acceleration(u, w, pull, field) + 2 * place.rate_s * w - u
    along = place.reach_s2 * (w.real * w.real + w.imag * w.imag) - place.acceleration - vertical(u)
    return np.stack([across.real, across.imag, along], axis=1)
