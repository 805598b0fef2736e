"""Equations of motion of rope and housing for all hypotheses at once, with their derivatives by the state.

With k = g/L, F the horizontal force on the load per weight and p the pivot's horizontal acceleration over g,

    u' = u_z w      w' = k (u + F - p) - (c + 2 L'/L) w      u_z = -sqrt(1 - |u|^2)

and the reading at the distance r below the pivot, which holds whatever moves the pivot, is in units of g

    f_xy = p + (r w' + 2 r' w)/g - u      f_z = -u_z + (r |w|^2 - r'')/g - p . u/u_z

Without p and F these are the equations of `gateway.swing.model.spherical_pendulum`. Eliminating p from the first two gives
f_xy = -(L - r) w'/g + F: the transverse reading is the rope's angular acceleration.
"""

import numpy as np

from gateway.motion.hypotheses import (
    GUST_RATE_1_S,
    IS_DRIVEN,
    IS_GUST,
    LOAD_SIGN,
    N_HYPOTHESES,
    PIVOT_RATE_1_S,
    PIVOT_SIGN,
)
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    LINE,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    OFFSET,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
    TURNING,
)
from gateway.numerics.array import Array

SMALLEST_COSINE = 0.2
"""Cosine of the rope's angle below which the equations are not continued: 78 degrees."""
LARGEST_SINE_SQUARED = 1 - SMALLEST_COSINE**2
"""Definition."""
LONGEST_ROPE_LN_M, SHORTEST_ROPE_LN_M = np.log(1000.0), np.log(0.05)
SPIN_TIME_S = 60.0
"""Time after which a turning housing has come to rest."""
_PIVOT, _LOAD = PIVOT_SIGN[:, None], LOAD_SIGN[:, None]
_OTHER_OF_PAIR = np.arange(TURNING.stop) ^ 1
_TURN_SIGN = np.where(np.arange(TURNING.stop) % 2 == 0, 1.0, -1.0)


class RopeModel:
    """The equations for one crane, with the constants that are not estimated."""

    def __init__(self, gravity_m_s2: float, is_clamped: bool) -> None:
        """`is_clamped`: the housing moves with the rope (stated by its distance from the load); False: it keeps its distance
        from the pivot.
        """
        self.gravity_m_s2, self.is_clamped = gravity_m_s2, is_clamped
        self._linear = _linear_equations(gravity_m_s2)
        self._reading_constants = np.zeros((N_HYPOTHESES, 3, N_STATES))
        self._reading_constants[:, 2, HOIST_ACCELERATION] = -float(is_clamped) / gravity_m_s2

    def rate(self, x: Array) -> tuple[Array, Array]:
        """Return x' and its derivative by x, shapes (m, N_STATES) and (m, N_STATES, N_STATES); the line is propagated apart."""
        u, w, speed, spin = x[:, GRAVITY], x[:, RATE], x[:, HOIST_SPEED], x[:, SPIN, None]
        per_length = np.exp(-x[:, LN_LENGTH])
        k, growth = self.gravity_m_s2 * per_length, speed * per_length
        cosine, damping = _cosine(u), x[:, DAMPING] + 2 * growth
        restoring = k[:, None] * (u + x[:, SIDE_FORCE] + _LOAD * x[:, INPUT])
        turned = _TURN_SIGN * x[:, _OTHER_OF_PAIR]
        rate: Array = np.matvec(self._linear, x)
        rate[:, GRAVITY] = -cosine[:, None] * w
        rate[:, RATE] = restoring - damping[:, None] * w
        rate[:, TURNING] += spin * turned
        rate[:, LN_LENGTH] = growth

        jacobian = self._linear.copy()
        jacobian[:, GRAVITY, GRAVITY] = w[:, :, None] * (u / cosine[:, None])[:, None, :]
        pair_diagonal(jacobian, GRAVITY, RATE)[:] = -cosine[:, None]
        for force in (GRAVITY, SIDE_FORCE):
            pair_diagonal(jacobian, RATE, force)[:] = k[:, None]
        pair_diagonal(jacobian, RATE, INPUT)[:] = _LOAD * k[:, None]
        pair_diagonal(jacobian, RATE, RATE)[:] = -damping[:, None]
        jacobian[:, RATE, LN_LENGTH] = (2 * growth)[:, None] * w - restoring
        jacobian[:, RATE, HOIST_SPEED] = (-2 * per_length)[:, None] * w
        jacobian[:, RATE, DAMPING] = -w
        jacobian[:, LN_LENGTH, LN_LENGTH], jacobian[:, LN_LENGTH, HOIST_SPEED] = -growth, per_length
        above, below = _pair_off_diagonals(jacobian)
        above += spin
        below -= spin
        jacobian[:, TURNING, SPIN] = turned
        return rate, jacobian

    def reading(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the reading and its derivative by x, shapes (m, 3) and (m, 3, N_STATES), and r/g, shape (m,)."""
        g, clamped = self.gravity_m_s2, float(self.is_clamped)
        u, w, pivot, mount = x[:, GRAVITY], x[:, RATE], _PIVOT * x[:, INPUT], x[:, MOUNT]
        length_m, speed = np.exp(x[:, LN_LENGTH]), x[:, HOIST_SPEED]
        k, growth = g / length_m, speed / length_m
        place_s2 = (length_m - x[:, PLACE] if self.is_clamped else x[:, PLACE]) / g
        share = place_s2 * k  # r/L
        cosine, damping = _cosine(u)[:, None], x[:, DAMPING] + 2 * growth
        restoring = k[:, None] * (u + x[:, SIDE_FORCE] + _LOAD * x[:, INPUT])
        across_1_s2 = restoring - damping[:, None] * w  # w'
        squared_1_s2 = np.vecdot(w, w)
        lifting = np.vecdot(pivot, u)[:, None] / cosine
        by_rate = (2 * clamped / g) * speed - place_s2 * damping
        ideal = np.empty((len(x), 3))
        ideal[:, :2] = pivot - u + place_s2[:, None] * restoring + by_rate[:, None] * w
        ideal[:, 2] = (cosine + lifting)[:, 0] + place_s2 * squared_1_s2 - (clamped / g) * x[:, HOIST_ACCELERATION]

        by_state = self._reading_constants.copy()
        pair_diagonal(by_state, _XY, GRAVITY)[:] = (share - 1)[:, None]
        pair_diagonal(by_state, _XY, SIDE_FORCE)[:] = share[:, None]
        pair_diagonal(by_state, _XY, INPUT)[:] = _PIVOT + _LOAD * share[:, None]
        pair_diagonal(by_state, _XY, RATE)[:] = by_rate[:, None]
        across_by_ln_length = (2 * growth)[:, None] * w - restoring
        by_place = (-1.0 if self.is_clamped else 1.0) / g
        by_state[:, :2, LN_LENGTH] = place_s2[:, None] * across_by_ln_length
        if self.is_clamped:
            by_state[:, :2, LN_LENGTH] += across_1_s2 / k[:, None]
            by_state[:, 2, LN_LENGTH] = squared_1_s2 / k
        by_state[:, :2, HOIST_SPEED] = 2 * (clamped / g - place_s2 / length_m)[:, None] * w
        by_state[:, :2, DAMPING] = -place_s2[:, None] * w
        by_state[:, :2, PLACE] = by_place * across_1_s2
        by_state[:, 2, PLACE] = by_place * squared_1_s2
        by_state[:, 2, GRAVITY] = (pivot - (1 - lifting / cosine) * u) / cosine
        by_state[:, 2, RATE] = (2 * place_s2)[:, None] * w
        by_state[:, 2, INPUT] = _PIVOT * u / cosine

        tilt = _tilt(mount)
        reading, jacobian = np.matvec(tilt, ideal), tilt @ by_state
        reading[:, :2] += x[:, OFFSET] - mount + share[:, None] * x[:, LINE]
        reading[:, 2] += x[:, AXIAL_OFFSET]
        pair_diagonal(jacobian, _XY, OFFSET)[:] = 1.0
        pair_diagonal(jacobian, _XY, MOUNT)[:] = ideal[:, 2:] - 1
        # The share's own derivatives are left out: a fast oscillation is no measure of length and place.
        pair_diagonal(jacobian, _XY, LINE)[:] = share[:, None]
        jacobian[:, 2, AXIAL_OFFSET] = 1.0
        jacobian[:, 2, MOUNT] = -ideal[:, :2]
        return reading, jacobian, place_s2

    def keep_in_domain(self, x: Array) -> None:
        """Limit angle and rope length to the domain of the equations, in place."""
        u, ln_length = x[:, GRAVITY], x[:, LN_LENGTH]
        squared = np.vecdot(u, u)
        if squared.max() > LARGEST_SINE_SQUARED:
            u *= np.sqrt(LARGEST_SINE_SQUARED / np.maximum(squared, LARGEST_SINE_SQUARED))[:, None]
        np.maximum(ln_length, SHORTEST_ROPE_LN_M, out=ln_length)
        np.minimum(ln_length, LONGEST_ROPE_LN_M, out=ln_length)


def axial_curvature(covariance: Array, place_s2: Array) -> tuple[Array, Array]:
    """Return what the axial reading's second derivative adds to its mean and variance, each of shape (m,).

    With the Hessian H, that is -1 for u, 2 r/g for w and 1 between p and u: tr(HP)/2 and tr(HPHP)/2 (Bar-Shalom et al. 2001,
    eq. 10.3.2-13).
    """
    hessian = _AXIAL_HESSIAN.copy()
    pair_diagonal(hessian, RATE, RATE)[:] = (2 * place_s2)[:, None]
    product = hessian @ covariance[:, : INPUT.stop, : INPUT.stop]
    mean = 0.5 * np.trace(product, axis1=1, axis2=2)
    variance = 0.5 * (product * product.transpose(0, 2, 1)).sum(axis=(1, 2))
    return mean, variance


def pair_diagonal(matrices: Array, rows: slice, columns: slice) -> Array:
    """Return a view of the diagonal of the block that a pair of rows and a pair of columns share, shape (m, 2)."""
    width = matrices.shape[2]
    first = rows.start * width + columns.start
    return matrices.reshape(len(matrices), -1)[:, first : first + width + 2 : width + 1]


def _pair_off_diagonals(matrices: Array) -> tuple[Array, Array]:
    """Return views of the elements (x, y) and (y, x) of all turning pairs, each of shape (m, pairs)."""
    width = matrices.shape[2]
    flat, step, end = matrices.reshape(len(matrices), -1), 2 * (width + 1), TURNING.stop * width
    return flat[:, 1:end:step], flat[:, width : end + width : step]


def _tilt(mount: Array) -> Array:
    """Return the small rotation from rope to housing, shape (m, 3, 3)."""
    tilt = np.tile(np.eye(3), (len(mount), 1, 1))
    tilt[:, :2, 2], tilt[:, 2, :2] = mount, -mount
    return tilt


def _linear_equations(gravity_m_s2: float) -> Array:
    """Return the constant part of the derivative of x' by x, shape (m, N_STATES, N_STATES)."""
    decay_1_s = (IS_DRIVEN * PIVOT_RATE_1_S + IS_GUST * GUST_RATE_1_S)[:, None]
    linear = np.zeros((N_HYPOTHESES, N_STATES, N_STATES))
    pair_diagonal(linear, INPUT, INPUT_RATE)[:] = 1.0
    pair_diagonal(linear, INPUT_RATE, INPUT_RATE)[:] = -2 * decay_1_s
    pair_diagonal(linear, INPUT_RATE, INPUT)[:] = -(decay_1_s**2)
    pair_diagonal(linear, PIVOT_VELOCITY, INPUT)[:] = gravity_m_s2 * _PIVOT
    linear[:, SPIN, SPIN] = -1 / SPIN_TIME_S
    linear[:, HOIST_SPEED, HOIST_ACCELERATION] = 1.0
    return linear


def _axial_hessian() -> Array:
    hessian = np.zeros((N_HYPOTHESES, INPUT.stop, INPUT.stop))
    pair_diagonal(hessian, GRAVITY, GRAVITY)[:] = -1.0
    pair_diagonal(hessian, GRAVITY, INPUT)[:] = pair_diagonal(hessian, INPUT, GRAVITY)[:] = _PIVOT
    return hessian


def _cosine(u: Array) -> Array:
    cosine: Array = np.sqrt(np.maximum(1 - np.vecdot(u, u), SMALLEST_COSINE**2))
    return cosine


_XY = slice(0, 2)
_AXIAL_HESSIAN = _axial_hessian()
