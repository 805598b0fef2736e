"""Equations of motion of rope, load and crane for all hypotheses at once, with their derivatives by the state.

With k = g/L, F the horizontal force on the load per weight (steady and gust), p the pivot's horizontal acceleration over g, z its
vertical one and Q the difference of the stiffness in two directions,

    u' = u_z w      w' = k (1 + Q)(u + F - p) - (c + 2 L'/L) w      u_z = -sqrt(1 - |u|^2)

and the reading at the distance r below the pivot and l beside the rope, which holds whatever moves the pivot, is in units of g

    f_xy = p + (r w' + 2 r' w)/g - u      f_z = -u_z + (r |w|^2 - r'' + l . w')/g - p . u/u_z + z

Without p, F, Q and l these are the equations of `gateway.swing.model.spherical_pendulum`. Eliminating p from the first two gives
f_xy = -(L - r) w'/g + F: the transverse reading is the rope's angular acceleration. A housing on a spreader does not turn with
the ropes: it tilts against them by (1 + q) u, and reads the direction of the ropes' force, whatever moves the pivot.
"""

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    GUST,
    HEAVE,
    HEAVE_RATE,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    LEVER,
    LINE,
    LN_LENGTH,
    MOUNT,
    N_MOVING,
    N_STATES,
    OFFSET,
    PIVOT,
    PIVOT_RATE,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
    STIFFNESS,
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
LONGEST_SHARE = 4.0
"""Of the rope's length as stated: a longer one, or a shorter one than its inverse, is not believed."""
SHORTEST_PER_PLACE = 0.85
"""Shortest rope that is believed, over the distance of a housing on it above the load. Basis: the housing is below the pivot;
ropes that converge swing as one that is a tenth shorter."""
SHORTEST_PLACE_M = 0.01
"""Distance above the load that a logarithm is taken of; a housing at the load bounds no length."""
SPIN_TIME_S = 60.0
"""Time after which a turning housing has come to rest."""
PIVOT_VELOCITY_TIME_S = 60.0
"""Time after which a velocity of the pivot is forgotten. Basis: longer than cranes drive; errors of it do not pile up."""
_XY = slice(0, 2)
_SPREADER_TILT = slice(PLACE, LEVER.stop)
"""PLACE and LEVER stand together."""
_TURNING_X = np.arange(TURNING.start, TURNING.stop, 2)
_TURNING_Y = _TURNING_X + 1
_IDENTITY = np.eye(2)
_IDENTITIES = np.tile(np.eye(3), (N_HYPOTHESES, 1, 1))


class RopeModel:
    """The equations for one crane, with what is not estimated."""

    def __init__(
        self,
        gravity_m_s2: float,
        stated_length_m: float,
        *,
        is_clamped: bool,
        on_spreader: bool = False,
        n_states: int = N_STATES,
    ) -> None:
        """`is_clamped`: the housing moves with the rope (stated by its distance from the load); False: it keeps its distance
        from the pivot. `on_spreader`: it does not turn with the ropes. `n_states`: with those of a gyroscope where there is one;
        they are constant and do not show in a force.
        """
        self.gravity_m_s2, self.is_clamped, self.on_spreader = gravity_m_s2, is_clamped, on_spreader
        self._n_states = n_states
        self._ln_bounds = np.log([stated_length_m / LONGEST_SHARE, stated_length_m * LONGEST_SHARE])
        linear = np.zeros((N_HYPOTHESES, N_MOVING, n_states))
        linear[:, PIVOT, PIVOT_RATE] = _IDENTITY
        linear[:, PIVOT_VELOCITY, PIVOT] = gravity_m_s2 * _IDENTITY
        linear[:, PIVOT_VELOCITY, PIVOT_VELOCITY] = -_IDENTITY / PIVOT_VELOCITY_TIME_S
        linear[:, SPIN, SPIN] = -1 / SPIN_TIME_S
        linear[:, HOIST_SPEED, HOIST_ACCELERATION] = 1.0
        linear[:, HEAVE, HEAVE_RATE] = 1.0
        self._linear = linear

    def rate(self, x: Array) -> tuple[Array, Array]:
        """Return the derivative of the moving states by time and its derivative by x, shapes (m, N_MOVING), (m, N_MOVING, n)."""
        u, w, spin = x[:, GRAVITY], x[:, RATE], x[:, SPIN, None]
        per_length = np.exp(-x[:, LN_LENGTH, None])
        k, growth = self.gravity_m_s2 * per_length, per_length * x[:, HOIST_SPEED, None]
        cosine, damping = _cosine(u)[:, None], x[:, DAMPING, None] + 2 * growth
        pull, stiffness = _pull(x), _symmetric(1.0, x[:, STIFFNESS])
        restoring = k * np.matvec(stiffness, pull)
        rate: Array = np.matvec(self._linear, x)
        rate[:, GRAVITY] = -cosine * w
        rate[:, RATE] = restoring - damping * w
        rate[:, _TURNING_X] += spin * x[:, _TURNING_Y]
        rate[:, _TURNING_Y] -= spin * x[:, _TURNING_X]
        rate[:, LN_LENGTH] = growth[:, 0]

        jacobian = self._linear.copy()
        jacobian[:, GRAVITY, GRAVITY] = w[:, :, None] * (u / cosine)[:, None]
        jacobian[:, GRAVITY, RATE] = -cosine[:, :, None] * _IDENTITY
        stiffness *= k[:, :, None]
        for acting in (GRAVITY, GUST, SIDE_FORCE):
            jacobian[:, RATE, acting] = stiffness
        jacobian[:, RATE, PIVOT] = -stiffness
        jacobian[:, RATE, RATE] -= damping[:, :, None] * _IDENTITY
        jacobian[:, RATE, LN_LENGTH] = 2 * growth * w - restoring
        jacobian[:, RATE, HOIST_SPEED] = -2 * per_length * w
        jacobian[:, RATE, DAMPING] = -w
        jacobian[:, RATE, STIFFNESS] = k[:, :, None] * _by_symmetric(pull)
        jacobian[:, LN_LENGTH, LN_LENGTH], jacobian[:, LN_LENGTH, HOIST_SPEED] = -growth[:, 0], per_length[:, 0]
        jacobian[:, _TURNING_X, _TURNING_Y] += spin
        jacobian[:, _TURNING_Y, _TURNING_X] -= spin
        jacobian[:, _TURNING_X, SPIN] = x[:, _TURNING_Y]
        jacobian[:, _TURNING_Y, SPIN] = -x[:, _TURNING_X]
        return rate, jacobian

    def reading(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the reading and its derivative by x, shapes (m, 3) and (m, 3, n), and r/g, shape (m,)."""
        return self._on_spreader(x) if self.on_spreader else self._on_rope(x)

    def _on_rope(self, x: Array) -> tuple[Array, Array, Array]:
        g, clamped = self.gravity_m_s2, float(self.is_clamped)
        u, w, pivot, mount, lever = x[:, GRAVITY], x[:, RATE], x[:, PIVOT], x[:, MOUNT], x[:, LEVER]
        length_m, speed_m_s = np.exp(x[:, LN_LENGTH, None]), x[:, HOIST_SPEED, None]
        place_m = (length_m if self.is_clamped else 0.0) + (-1.0 if self.is_clamped else 1.0) * x[:, PLACE, None]
        share, damping = place_m / length_m, x[:, DAMPING, None] + 2 * speed_m_s / length_m
        cosine, pull, stiffness = _cosine(u), _pull(x), _symmetric(1.0, x[:, STIFFNESS])
        restoring = np.matvec(stiffness, pull)
        by_rate = 2 * clamped / g * speed_m_s - place_m / g * damping
        across_over_g = restoring / length_m - damping / g * w  # w'/g
        squared_1_s2, lifting = np.vecdot(w, w), np.vecdot(pivot, u) / cosine
        ideal_xy = pivot - u + share * restoring + by_rate * w
        ideal_z = cosine + lifting + place_m[:, 0] / g * squared_1_s2 + x[:, HEAVE]
        ideal_z += np.vecdot(lever, across_over_g) - clamped / g * x[:, HOIST_ACCELERATION]

        ideal = np.zeros((len(x), 3, self._n_states))
        stiff_share = share[:, :, None] * stiffness
        ideal[:, _XY, GRAVITY] = stiff_share - _IDENTITY
        ideal[:, _XY, GUST] = ideal[:, _XY, SIDE_FORCE] = stiff_share
        ideal[:, _XY, PIVOT] = _IDENTITY - stiff_share
        ideal[:, _XY, RATE] = by_rate[:, :, None] * _IDENTITY
        ideal[:, _XY, STIFFNESS] = share[:, :, None] * _by_symmetric(pull)
        towards = -1.0 if self.is_clamped else 1.0
        by_ln_length = 2 * place_m / g * speed_m_s / length_m * w - share * restoring
        if self.is_clamped:
            by_ln_length += length_m * across_over_g
            ideal[:, 2, LN_LENGTH] = length_m[:, 0] / g * squared_1_s2
        ideal[:, _XY, LN_LENGTH] = by_ln_length
        ideal[:, _XY, HOIST_SPEED] = 2 * (clamped / g - place_m / g / length_m) * w
        ideal[:, _XY, DAMPING] = -place_m / g * w
        ideal[:, _XY, PLACE] = towards * across_over_g
        ideal[:, 2, PLACE] = towards / g * squared_1_s2
        of_lever = np.matvec(stiffness, lever) / length_m
        ideal[:, 2, GRAVITY] = (pivot - (1 - lifting / cosine)[:, None] * u) / cosine[:, None] + of_lever
        ideal[:, 2, GUST] = ideal[:, 2, SIDE_FORCE] = of_lever
        ideal[:, 2, PIVOT] = u / cosine[:, None] - of_lever
        ideal[:, 2, RATE] = 2 * place_m / g * w - damping / g * lever
        ideal[:, 2, LEVER] = across_over_g
        # The lever's effect on the derivatives by length, damping and stiffness is left out: below 2e-3 at 5 cm.
        ideal[:, 2, HOIST_ACCELERATION] = -clamped / g
        ideal[:, 2, HEAVE] = 1.0

        tilt = _IDENTITIES.copy()
        tilt[:, _XY, 2], tilt[:, 2, _XY] = mount, -mount
        tilt[:, 2, 2] -= 0.5 * np.vecdot(mount, mount)
        jacobian: Array = tilt @ ideal
        jacobian[:, _XY, OFFSET] = jacobian[:, _XY, LINE] = _IDENTITY
        jacobian[:, _XY, MOUNT] = (ideal_z - 1)[:, None, None] * _IDENTITY
        jacobian[:, 2, AXIAL_OFFSET] = 1.0
        jacobian[:, 2, MOUNT] = -ideal_xy - ideal_z[:, None] * mount
        reading = np.empty((len(x), 3))
        reading[:, _XY] = ideal_xy + x[:, OFFSET] + mount * (ideal_z - 1)[:, None] + x[:, LINE]
        # the second order counts: a housing askew by 7 degrees reads 7 mg less along the rope
        reading[:, 2] = ideal_z * (1 - 0.5 * np.vecdot(mount, mount)) + x[:, AXIAL_OFFSET] - np.vecdot(mount, ideal_xy)
        return reading, jacobian, place_m[:, 0] / g

    def _on_spreader(self, x: Array) -> tuple[Array, Array, Array]:
        g = self.gravity_m_s2
        u, w, pivot = x[:, GRAVITY], x[:, RATE], x[:, PIVOT]
        length_s2, tilt = np.exp(x[:, LN_LENGTH]) / g, _symmetric(1 + x[:, PLACE], x[:, LEVER])
        cosine, tilted = _cosine(u), np.matvec(tilt, u)
        lifting, squared_1_s2 = np.vecdot(pivot, u) / cosine, np.vecdot(w, w)
        tension = cosine + lifting + length_s2 * squared_1_s2 - x[:, HOIST_ACCELERATION] / g + x[:, HEAVE]
        by_state = np.zeros((len(x), self._n_states))
        by_state[:, GRAVITY] = (pivot - (1 - lifting / cosine)[:, None] * u) / cosine[:, None]
        by_state[:, PIVOT], by_state[:, RATE] = u / cosine[:, None], (2 * length_s2)[:, None] * w
        by_state[:, LN_LENGTH], by_state[:, HOIST_ACCELERATION], by_state[:, HEAVE] = (
            length_s2 * squared_1_s2,
            -1 / g,
            1.0,
        )
        lowered = 1 - 0.5 * np.vecdot(tilted, tilted)
        jacobian = np.empty((len(x), 3, self._n_states))
        jacobian[:, _XY] = tilted[:, :, None] * by_state[:, None]
        jacobian[:, 2] = lowered[:, None] * by_state
        by_tilt = np.concatenate([u[:, :, None], _by_symmetric(u)], axis=2)
        jacobian[:, _XY, GRAVITY] += tension[:, None, None] * tilt
        jacobian[:, _XY, _SPREADER_TILT] += tension[:, None, None] * by_tilt
        jacobian[:, 2, GRAVITY] -= tension[:, None] * np.matvec(tilt, tilted)
        jacobian[:, 2, _SPREADER_TILT] -= tension[:, None] * np.vecmat(tilted, by_tilt)
        for acting in (GUST, SIDE_FORCE, OFFSET, LINE):
            jacobian[:, _XY, acting] = _IDENTITY
        jacobian[:, 2, AXIAL_OFFSET] = 1.0
        reading = np.empty((len(x), 3))
        reading[:, _XY] = tension[:, None] * tilted + x[:, GUST] + x[:, SIDE_FORCE] + x[:, OFFSET] + x[:, LINE]
        reading[:, 2] = tension * lowered + x[:, AXIAL_OFFSET]
        return reading, jacobian, length_s2

    def keep_in_domain(self, x: Array) -> None:
        """Limit angle and rope length to the domain of the equations, in place."""
        u, ln_length = x[:, GRAVITY], x[:, LN_LENGTH]
        squared = np.vecdot(u, u)
        if squared.max() > LARGEST_SINE_SQUARED:
            u *= np.sqrt(LARGEST_SINE_SQUARED / np.maximum(squared, LARGEST_SINE_SQUARED))[:, None]
        np.clip(ln_length, *self._ln_bounds, out=ln_length)
        if self.is_clamped and not self.on_spreader:  # the housing is below the pivot
            place_m = np.maximum(x[:, PLACE], SHORTEST_PLACE_M)
            np.maximum(ln_length, np.log(SHORTEST_PER_PLACE * place_m), out=ln_length)


def axial_curvature(covariance: Array, place_s2: Array) -> tuple[Array, Array]:
    """Return what the axial reading's second derivative adds to its mean and variance, each of shape (m,).

    With the Hessian H, that is -1 for u, 2 r/g for w and 1 between p and u: tr(HP)/2 and tr(HPHP)/2 (Bar-Shalom et al. 2001,
    eq. 10.3.2-13).
    """
    block = covariance[:, : PIVOT.stop, : PIVOT.stop]
    product = np.empty_like(block)
    product[:, GRAVITY] = block[:, PIVOT] - block[:, GRAVITY]
    product[:, RATE] = 2 * place_s2[:, None, None] * block[:, RATE]
    product[:, PIVOT] = block[:, GRAVITY]
    flat, transposed = product.reshape(len(product), -1), product.transpose(0, 2, 1).reshape(len(product), -1)
    return 0.5 * flat[:, :: PIVOT.stop + 1].sum(axis=1), 0.5 * np.vecdot(flat, transposed)


def _pull(x: Array) -> Array:
    """Return u + F - p, shape (m, 2)."""
    found: Array = x[:, GRAVITY] + x[:, GUST] + x[:, SIDE_FORCE] - x[:, PIVOT]
    return found


def _symmetric(mean: Array | float, difference: Array) -> Array:
    """Return symmetric matrices by half of their trace and their components along x against y and along the diagonals."""
    along, diagonal = difference.T
    found = np.empty((len(difference), 2, 2))
    found[:, 0, 0], found[:, 1, 1] = mean + along, mean - along
    found[:, 0, 1] = found[:, 1, 0] = diagonal
    return found


def _by_symmetric(vector: Array) -> Array:
    """Return the derivative of such a matrix times a vector by both components, shape (m, 2, 2)."""
    found = np.empty((len(vector), 2, 2))
    found[:, 0, 0], found[:, 1, 0] = vector[:, 0], -vector[:, 1]
    found[:, 0, 1], found[:, 1, 1] = vector[:, 1], vector[:, 0]
    return found


def _cosine(u: Array) -> Array:
    """Return the cosine of the rope's angle, shape (m,)."""
    found: Array = np.sqrt(np.maximum(1 - np.vecdot(u, u), SMALLEST_COSINE**2))
    return found
