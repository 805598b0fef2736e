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

The physics is that of `devices.simulated.pendulum` in other coordinates; a test holds the two together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Field:
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

    def at(self, _half_step: int) -> "Field":
        """The same at every half step of an integration."""
        return self


@dataclass(frozen=True, slots=True)
class Course:
    """What the motion follows while the rope's length changes: the first dimension is the half steps of an integration."""

    stiffness_1_s2: Real
    damping_1_s: Real
    lengthening_1_s: Real

    def at(self, half_step: int) -> Field:
        """At a half step."""
        return Field(self.stiffness_1_s2[half_step], self.damping_1_s, lengthening_1_s=self.lengthening_1_s[half_step])


@dataclass(frozen=True, slots=True)
class Place:
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


def vertical(u: Complex) -> Real:
    """u_z, negative: the rope hangs. NaN where the motion has left the model (90 degrees)."""
    u_z: Real = -np.sqrt(1.0 - (u.real * u.real + u.imag * u.imag))
    return u_z


def transverse_acceleration(u: Complex, w: Complex, pull: Complex, field: Field) -> Complex:
    """n'' across the rope in 1/s^2: the right-hand side of w'."""
    damping = field.damping_1_s
    if field.drag is not None:
        damping = damping + field.drag * np.abs(w)
    if field.lengthening_1_s is not None:
        damping = damping + 2 * field.lengthening_1_s
    acceleration: Complex = field.stiffness_1_s2 * (u + pull) - damping * w
    return acceleration


def state_rate(state: Complex, field: Field) -> Complex:
    """Time derivative of states of shape (3, ...)."""
    u, w, pull = state
    u_z = vertical(u)
    rate = np.empty_like(state)
    np.multiply(u_z, w, out=rate[0])
    rate[1] = transverse_acceleration(u, w, pull, field)
    np.multiply((pull.real * u.real + pull.imag * u.imag) / -u_z, w, out=rate[2])
    if field.spin_1_s is not None:
        rate -= 1j * field.spin_1_s * state
    return rate


def integrate(state: Complex, field: Field | Course, step_s: float, steps: int) -> Path:
    """Carry states of shape (3, ...) on by `steps` classical fourth-order Runge-Kutta steps; NaN beyond 90 degrees."""
    states = np.empty((steps + 1, *state.shape), dtype=np.complex128)
    rates = np.empty_like(states)
    half_s = step_s / 2
    with np.errstate(invalid="ignore", over="ignore"):
        for i in range(steps):
            begin, middle, end = field.at(2 * i), field.at(2 * i + 1), field.at(2 * i + 2)
            k1 = state_rate(state, begin)
            k2 = state_rate(state + half_s * k1, middle)
            k3 = state_rate(state + half_s * k2, middle)
            k4 = state_rate(state + step_s * k3, end)
            states[i], rates[i] = state, k1
            state = state + step_s / 6 * (k1 + k4 + 2 * (k2 + k3))
        states[steps], rates[steps] = state, state_rate(state, field.at(2 * steps))
    return Path(states, rates, step_s)


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


def specific_force_g(state: Complex, field: Field, place: Place) -> Real:
    """What the housing reads, shape (n, 3, ...) for states of shape (n, 3, ...)."""
    u, w, pull = state[:, 0], state[:, 1], state[:, 2]
    across = place.reach_s2 * transverse_acceleration(u, w, pull, field) + 2 * place.rate_s * w - u
    along = place.reach_s2 * (w.real * w.real + w.imag * w.imag) - place.acceleration - vertical(u)
    return np.stack([across.real, across.imag, along], axis=1)
