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
LARGEST_ANGLE_RAD = float(np.arccos(SMALLEST_COSINE)) - np.radians(2.0)
"""An angle whose interval reaches it is not known. Basis: a limited state swings on from the limit; on a real pendulum from 101
degrees it was told up to two degrees below."""
LARGEST_SINE_SQUARED = 1 - SMALLEST_COSINE**2
"""Definition."""
LONGEST_ROPE_LN_M, SHORTEST_ROPE_LN_M = np.log(1000.0), np.log(0.05)
SPIN_TIME_S = 60.0
"""Time after which a turning housing has come to rest."""
PIVOT_VELOCITY_TIME_S = 60.0
"""Time after which a velocity of the pivot is forgotten. Basis: longer than cranes drive; errors of it do not pile up."""
_PIVOT, _LOAD = np.tile(PIVOT_SIGN, (2, 1)), np.tile(LOAD_SIGN, (2, 1))
_XY = slice(0, 2)
_OTHER_OF_PAIR = np.arange(TURNING.stop) ^ 1
_TURN_SIGN = np.tile([[1.0], [-1.0]], (TURNING.stop // 2, N_HYPOTHESES))


class RopeModel:
    """The equations for one crane, with the constants that are not estimated.

    Inside, arrays have the hypotheses last, and scalars are pairs of equal rows: NumPy takes a third of the time for contiguous
    arrays of the same shape.
    """

    def __init__(self, gravity_m_s2: float, is_clamped: bool, n_states: int = N_STATES) -> None:
        """`is_clamped`: the housing moves with the rope (stated by its distance from the load); False: it keeps its distance
        from the pivot. `n_states`: with those of a gyroscope where there is one; they are constant and do not show in a force.
        """
        self.gravity_m_s2, self.is_clamped = gravity_m_s2, is_clamped
        self._linear = np.zeros((N_HYPOTHESES, n_states, n_states))
        self._linear[:, :N_STATES, :N_STATES] = _linear_equations(gravity_m_s2)
        self._reading_constants = np.zeros((N_HYPOTHESES, 3, n_states))
        self._reading_constants[:, 2, HOIST_ACCELERATION] = -float(is_clamped) / gravity_m_s2

    def rate(self, x: Array) -> tuple[Array, Array]:
        """Return x' and its derivative by x, shapes (m, n) and (m, n, n); the line is propagated apart."""
        states = x.T.copy()
        u, w, spin = states[GRAVITY], states[RATE], states[SPIN]
        per_length = np.exp(-_twice(states, LN_LENGTH))
        k, growth = self.gravity_m_s2 * per_length, per_length * _twice(states, HOIST_SPEED)
        cosine, damping = _cosine(u), _twice(states, DAMPING) + 2 * growth
        restoring = k * (u + states[SIDE_FORCE] + _LOAD * states[INPUT])
        turned = _TURN_SIGN * states.take(_OTHER_OF_PAIR, axis=0)
        rate: Array = np.matvec(self._linear, x)
        rate[:, GRAVITY] = (-cosine * w).T
        rate[:, RATE] = (restoring - damping * w).T
        rate[:, TURNING] += (spin * turned).T
        rate[:, LN_LENGTH] = growth[0]

        jacobian = self._linear.copy()
        jacobian[:, GRAVITY, GRAVITY] = (w[:, None] * (u / cosine)).transpose(2, 0, 1)
        set_pair_diagonal(jacobian, GRAVITY, RATE, -cosine)
        set_pair_diagonal(jacobian, RATE, GRAVITY, k)
        set_pair_diagonal(jacobian, RATE, SIDE_FORCE, k)
        set_pair_diagonal(jacobian, RATE, INPUT, _LOAD * k)
        set_pair_diagonal(jacobian, RATE, RATE, -damping)
        jacobian[:, RATE, LN_LENGTH] = (2 * growth * w - restoring).T
        jacobian[:, RATE, HOIST_SPEED] = (-2 * per_length * w).T
        jacobian[:, RATE, DAMPING] = -w.T
        jacobian[:, LN_LENGTH, LN_LENGTH], jacobian[:, LN_LENGTH, HOIST_SPEED] = -growth[0], per_length[0]
        above, below = _pair_off_diagonals(jacobian)
        above += spin[:, None]
        below -= spin[:, None]
        jacobian[:, TURNING, SPIN] = turned.T
        return rate, jacobian

    def reading(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the reading and its derivative by x, shapes (m, 3) and (m, 3, n), and r/g, shape (m,)."""
        g, clamped = self.gravity_m_s2, float(self.is_clamped)
        states = x.T.copy()
        u, w, pivot, mount = states[GRAVITY], states[RATE], _PIVOT * states[INPUT], states[MOUNT]
        length_m, speed_m_s, place_m = (_twice(states, state) for state in (LN_LENGTH, HOIST_SPEED, PLACE))
        np.exp(length_m, out=length_m)
        place_s2 = (length_m - place_m if self.is_clamped else place_m) / g
        share = g * place_s2 / length_m  # r/L
        cosine, damping = _cosine(u), _twice(states, DAMPING) + 2 * speed_m_s / length_m
        restoring = u + states[SIDE_FORCE] + _LOAD * states[INPUT]
        by_rate = (2 * clamped / g) * speed_m_s - place_s2 * damping
        squared_1_s2 = np.vecdot(w.T, w.T)
        lifting = _twice_row(np.vecdot(pivot.T, u.T)) / cosine
        ideal_xy = pivot - u + share * restoring + by_rate * w
        ideal_z = cosine[0] + lifting[0] + place_s2[0] * squared_1_s2 - (clamped / g) * states[HOIST_ACCELERATION]

        ideal = self._reading_constants.copy()
        set_pair_diagonal(ideal, _XY, GRAVITY, share - 1)
        set_pair_diagonal(ideal, _XY, SIDE_FORCE, share)
        set_pair_diagonal(ideal, _XY, INPUT, _PIVOT + _LOAD * share)
        set_pair_diagonal(ideal, _XY, RATE, by_rate)
        across_over_g = restoring / length_m - damping / g * w  # w'/g
        towards = -1.0 if self.is_clamped else 1.0
        by_ln_length = 2 * place_s2 * speed_m_s / length_m * w - share * restoring
        if self.is_clamped:
            by_ln_length += length_m * across_over_g
            ideal[:, 2, LN_LENGTH] = length_m[0] / g * squared_1_s2
        ideal[:, _XY, LN_LENGTH] = by_ln_length.T
        ideal[:, _XY, HOIST_SPEED] = (2 * (clamped / g - place_s2 / length_m) * w).T
        ideal[:, _XY, DAMPING] = (-place_s2 * w).T
        ideal[:, _XY, PLACE] = (towards * across_over_g).T
        ideal[:, 2, PLACE] = towards / g * squared_1_s2
        ideal[:, 2, GRAVITY] = ((pivot - (1 - lifting / cosine) * u) / cosine).T
        ideal[:, 2, RATE] = (2 * place_s2 * w).T
        ideal[:, 2, INPUT] = (_PIVOT * u / cosine).T

        tilt = _IDENTITIES.copy()
        tilt[:, _XY, 2], tilt[:, 2, _XY] = mount.T, -mount.T
        jacobian: Array = tilt @ ideal
        set_pair_diagonal(jacobian, _XY, OFFSET, _ONES)
        set_pair_diagonal(jacobian, _XY, MOUNT, _twice_row(ideal_z - 1))
        # The share's own derivatives are left out: a fast oscillation is no measure of length and place.
        set_pair_diagonal(jacobian, _XY, LINE, share)
        jacobian[:, 2, AXIAL_OFFSET] = 1.0
        jacobian[:, 2, MOUNT] = -ideal_xy.T
        reading = np.empty((len(x), 3))
        reading[:, _XY] = (ideal_xy + states[OFFSET] + mount * _twice_row(ideal_z - 1) + share * states[LINE]).T
        reading[:, 2] = ideal_z + states[AXIAL_OFFSET] - np.vecdot(mount.T, ideal_xy.T)
        return reading, jacobian, place_s2[0]

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
    set_pair_diagonal(hessian, RATE, RATE, _twice_row(2 * place_s2))
    product = hessian @ covariance[:, : INPUT.stop, : INPUT.stop]
    transposed = product.transpose(0, 2, 1).reshape(len(product), -1)
    flat = product.reshape(len(product), -1)
    return 0.5 * flat[:, :: INPUT.stop + 1].sum(axis=1), 0.5 * np.vecdot(flat, transposed)


def set_pair_diagonal(matrices: Array, rows: slice, columns: slice, values: Array) -> None:
    """Set the diagonal of the block that a pair of rows and a pair of columns share; `values`: shape (2, m)."""
    matrices[:, rows.start, columns.start] = values[0]
    matrices[:, rows.start + 1, columns.start + 1] = values[1]


def _pair_off_diagonals(matrices: Array) -> tuple[Array, Array]:
    """Return views of the elements (x, y) and (y, x) of all turning pairs, each of shape (m, pairs)."""
    width = matrices.shape[2]
    flat, step, end = matrices.reshape(len(matrices), -1), 2 * (width + 1), TURNING.stop * width
    return flat[:, 1:end:step], flat[:, width : end + width : step]


def _twice(states: Array, state: int) -> Array:
    """Return a scalar state, of shape (N_STATES, m), as a pair of equal rows."""
    found: Array = states.take((state, state), axis=0)
    return found


def _linear_equations(gravity_m_s2: float) -> Array:
    """Return the constant part of the derivative of x' by x, shape (m, N_STATES, N_STATES)."""
    decay_1_s = _ONES * (IS_DRIVEN * PIVOT_RATE_1_S + IS_GUST * GUST_RATE_1_S)
    linear = np.zeros((N_HYPOTHESES, N_STATES, N_STATES))
    set_pair_diagonal(linear, INPUT, INPUT_RATE, _ONES)
    set_pair_diagonal(linear, INPUT_RATE, INPUT_RATE, -2 * decay_1_s)
    set_pair_diagonal(linear, INPUT_RATE, INPUT, -(decay_1_s**2))
    set_pair_diagonal(linear, PIVOT_VELOCITY, INPUT, gravity_m_s2 * _PIVOT)
    set_pair_diagonal(linear, PIVOT_VELOCITY, PIVOT_VELOCITY, -_ONES / PIVOT_VELOCITY_TIME_S)
    linear[:, SPIN, SPIN] = -1 / SPIN_TIME_S
    linear[:, HOIST_SPEED, HOIST_ACCELERATION] = 1.0
    return linear


def _axial_hessian() -> Array:
    hessian = np.zeros((N_HYPOTHESES, INPUT.stop, INPUT.stop))
    set_pair_diagonal(hessian, GRAVITY, GRAVITY, -_ONES)
    set_pair_diagonal(hessian, GRAVITY, INPUT, _PIVOT)
    set_pair_diagonal(hessian, INPUT, GRAVITY, _PIVOT)
    return hessian


def _cosine(u: Array) -> Array:
    """Return the cosine of the rope's angle as a pair of equal rows."""
    return _twice_row(np.sqrt(np.maximum(1 - np.vecdot(u.T, u.T), SMALLEST_COSINE**2)))


def _twice_row(row: Array) -> Array:
    pair = np.empty((2, len(row)))
    pair[:] = row
    return pair


_ONES = np.ones((2, N_HYPOTHESES))
_IDENTITIES = np.tile(np.eye(3), (N_HYPOTHESES, 1, 1))
_AXIAL_HESSIAN = _axial_hessian()
