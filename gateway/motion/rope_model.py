"""Equations of motion of rope and housing for all hypotheses at once, with their derivatives by the state.

With k = g/L, F the horizontal force on the load per weight and p the pivot's horizontal acceleration over g,

    u' = u_z w      w' = k (u + F - p) - (c + 2 L'/L) w      u_z = -sqrt(1 - |u|^2)

and the reading at the distance r below the pivot, which holds whatever moves the pivot, is in units of g

    f_xy = p + (r w' + 2 r' w)/g - u      f_z = -u_z + (r |w|^2 - r'')/g - p . u/u_z

Without p and F these are the equations of `gateway.swing.model.spherical_pendulum`. Eliminating p from the first two gives
f_xy = -(L - r) w'/g + F: the transverse reading is the rope's angular acceleration.
"""

from dataclasses import dataclass

import numpy as np

from gateway.motion.hypotheses import (
    GUST_RATE_1_S,
    IS_DRIVEN,
    IS_GUST,
    LOAD_SIGN,
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
)
from gateway.numerics.array import Array

SMALLEST_COSINE = 0.2
"""Cosine of the rope's angle below which the equations are not continued: 78 degrees."""
LONGEST_ROPE_LN_M, SHORTEST_ROPE_LN_M = np.log(1000.0), np.log(0.05)
TURNING = (GRAVITY, RATE, INPUT, INPUT_RATE, SIDE_FORCE, PIVOT_VELOCITY)
"""Pairs that keep their direction in the world while the housing turns."""
_TURNING_X = np.array([pair.start for pair in TURNING])
_INPUT_DECAY_1_S = IS_DRIVEN * PIVOT_RATE_1_S + IS_GUST * GUST_RATE_1_S
SPIN_TIME_S = 60.0
"""Time after which a turning housing has come to rest."""
X, Y = 0, 1


def _pair(states: slice) -> list[int]:
    return list(range(states.start, states.stop))


@dataclass(frozen=True, slots=True)
class RopeModel:
    """The crane's constants that are not estimated."""

    gravity_m_s2: float
    is_clamped: bool
    """The housing moves with the rope (stated by its distance from the load); False: it keeps its distance from the pivot."""

    def rate(self, x: Array) -> tuple[Array, Array]:
        """Return x' and its derivative by x, shapes (m, N_STATES) and (m, N_STATES, N_STATES); the line is propagated apart."""
        u, w = x[:, GRAVITY], x[:, RATE]
        length_m = np.exp(x[:, LN_LENGTH])
        k, speed = self.gravity_m_s2 / length_m, x[:, HOIST_SPEED]
        cosine = _cosine(u)
        force = u + x[:, SIDE_FORCE] + LOAD_SIGN[:, None] * x[:, INPUT]
        damping = x[:, DAMPING] + 2 * speed / length_m
        rate = np.zeros_like(x)
        rate[:, GRAVITY] = -cosine[:, None] * w
        rate[:, RATE] = k[:, None] * force - damping[:, None] * w
        rate[:, INPUT] = x[:, INPUT_RATE]
        decay = _INPUT_DECAY_1_S[:, None]
        rate[:, INPUT_RATE] = -2 * decay * x[:, INPUT_RATE] - decay**2 * x[:, INPUT]
        rate[:, PIVOT_VELOCITY] = self.gravity_m_s2 * PIVOT_SIGN[:, None] * x[:, INPUT]
        rate[:, LN_LENGTH] = speed / length_m
        rate[:, HOIST_SPEED] = x[:, HOIST_ACCELERATION]

        spin, turning_x, turning_y = x[:, SPIN, None], x[:, _TURNING_X], x[:, _TURNING_X + 1]
        rate[:, _TURNING_X] += spin * turning_y
        rate[:, _TURNING_X + 1] -= spin * turning_x
        rate[:, SPIN] = -x[:, SPIN] / SPIN_TIME_S

        jacobian = np.zeros((len(x), N_STATES, N_STATES))
        jacobian[:, GRAVITY, GRAVITY] = w[:, :, None] * (u / cosine[:, None])[:, None, :]
        ln_length = -k[:, None] * force + (2 * speed / length_m)[:, None] * w
        for i in (X, Y):
            row = RATE.start + i
            jacobian[:, GRAVITY.start + i, row] = -cosine
            jacobian[:, row, GRAVITY.start + i] = k
            jacobian[:, row, SIDE_FORCE.start + i] = k
            jacobian[:, row, INPUT.start + i] = LOAD_SIGN * k
            jacobian[:, row, row] = -damping
            jacobian[:, PIVOT_VELOCITY.start + i, INPUT.start + i] = self.gravity_m_s2 * PIVOT_SIGN
            jacobian[:, INPUT.start + i, INPUT_RATE.start + i] = 1.0
            jacobian[:, INPUT_RATE.start + i, INPUT_RATE.start + i] = -2 * _INPUT_DECAY_1_S
            jacobian[:, INPUT_RATE.start + i, INPUT.start + i] = -(_INPUT_DECAY_1_S**2)
        jacobian[:, RATE, LN_LENGTH] = ln_length
        jacobian[:, RATE, HOIST_SPEED] = -2 * w / length_m[:, None]
        jacobian[:, RATE, DAMPING] = -w
        jacobian[:, _TURNING_X, _TURNING_X + 1] += spin
        jacobian[:, _TURNING_X + 1, _TURNING_X] -= spin
        jacobian[:, _TURNING_X, SPIN], jacobian[:, _TURNING_X + 1, SPIN] = turning_y, -turning_x
        jacobian[:, SPIN, SPIN] = -1 / SPIN_TIME_S
        jacobian[:, LN_LENGTH, LN_LENGTH] = -speed / length_m
        jacobian[:, LN_LENGTH, HOIST_SPEED] = 1 / length_m
        jacobian[:, HOIST_SPEED, HOIST_ACCELERATION] = 1.0
        return rate, jacobian

    def reading(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the reading in g, its derivative by x and r/g in s^2, shapes (m, 3), (m, 3, N_STATES) and (m,)."""
        g, clamped = self.gravity_m_s2, float(self.is_clamped)
        u, w, pivot = x[:, GRAVITY], x[:, RATE], PIVOT_SIGN[:, None] * x[:, INPUT]
        length_m = np.exp(x[:, LN_LENGTH])
        k, speed = g / length_m, x[:, HOIST_SPEED]
        place_s2 = (length_m - x[:, PLACE] if self.is_clamped else x[:, PLACE]) / g
        cosine = _cosine(u)
        force = u + x[:, SIDE_FORCE] + LOAD_SIGN[:, None] * x[:, INPUT]
        damping = x[:, DAMPING] + 2 * speed / length_m
        across_1_s2 = k[:, None] * force - damping[:, None] * w
        squared_1_s2 = (w * w).sum(axis=1)
        vertical_pivot = (pivot * u).sum(axis=1) / cosine
        ideal_xy = pivot + place_s2[:, None] * across_1_s2 + (2 * clamped / g) * speed[:, None] * w - u
        ideal_z = cosine + place_s2 * squared_1_s2 - (clamped / g) * x[:, HOIST_ACCELERATION] + vertical_pivot
        share = place_s2 * k  # r/L
        mount = x[:, MOUNT]
        reading = np.empty((len(x), 3))
        reading[:, :2] = ideal_xy + x[:, OFFSET] + mount * (ideal_z - 1)[:, None] + share[:, None] * x[:, LINE]
        reading[:, 2] = ideal_z + x[:, AXIAL_OFFSET] - (mount * ideal_xy).sum(axis=1)

        ideal = np.zeros((len(x), 3, N_STATES))
        by_place = (1.0 if not self.is_clamped else -1.0) / g
        ln_length = place_s2[:, None] * (-k[:, None] * force + (2 * speed / length_m)[:, None] * w)
        if self.is_clamped:
            ln_length = ln_length + (length_m / g)[:, None] * across_1_s2
            ideal[:, 2, LN_LENGTH] = length_m / g * squared_1_s2
        for i in (X, Y):
            ideal[:, i, GRAVITY.start + i] = share - 1
            ideal[:, i, SIDE_FORCE.start + i] = share
            ideal[:, i, INPUT.start + i] = PIVOT_SIGN + share * LOAD_SIGN
            ideal[:, i, RATE.start + i] = -place_s2 * damping + (2 * clamped / g) * speed
        ideal[:, :2, LN_LENGTH] = ln_length
        ideal[:, :2, HOIST_SPEED] = 2 * w * (clamped / g - place_s2 / length_m)[:, None]
        ideal[:, :2, DAMPING] = -place_s2[:, None] * w
        ideal[:, :2, PLACE] = by_place * across_1_s2
        ideal[:, 2, PLACE] = by_place * squared_1_s2
        ideal[:, 2, GRAVITY] = (pivot - (1 - vertical_pivot / cosine)[:, None] * u) / cosine[:, None]
        ideal[:, 2, RATE] = 2 * place_s2[:, None] * w
        ideal[:, 2, INPUT] = PIVOT_SIGN[:, None] * u / cosine[:, None]
        ideal[:, 2, HOIST_ACCELERATION] = -clamped / g

        jacobian = ideal.copy()
        jacobian[:, :2] += mount[:, :, None] * ideal[:, 2:3]
        jacobian[:, 2] -= mount[:, 0, None] * ideal[:, 0] + mount[:, 1, None] * ideal[:, 1]
        for i in (X, Y):
            jacobian[:, i, OFFSET.start + i] = 1.0
            jacobian[:, i, MOUNT.start + i] = ideal_z - 1
            # The share's own derivatives are left out: a fast oscillation is no measure of length and place.
            jacobian[:, i, LINE.start + i] = share
        jacobian[:, 2, AXIAL_OFFSET] = 1.0
        jacobian[:, 2, MOUNT] = -ideal_xy
        return reading, jacobian, place_s2

    def keep_in_domain(self, x: Array) -> None:
        """Limit angle and rope length to the domain of the equations, in place."""
        u = x[:, GRAVITY]
        squared = (u * u).sum(axis=1)
        largest = 1 - SMALLEST_COSINE**2
        if (squared > largest).any():
            u *= np.minimum(1.0, np.sqrt(largest / np.maximum(squared, largest)))[:, None]
        np.clip(x[:, LN_LENGTH], SHORTEST_ROPE_LN_M, LONGEST_ROPE_LN_M, out=x[:, LN_LENGTH])


def axial_curvature(covariance: Array, place_s2: Array) -> tuple[Array, Array]:
    """Return what the axial reading's second derivative adds to its mean and variance, each of shape (m,).

    With the Hessian H, that is -1 for u, 2 r/g for w and 1 between p and u: tr(HP)/2 and tr(HPHP)/2 (Bar-Shalom et al. 2001,
    eq. 10.3.2-13).
    """
    pairs = [*_pair(GRAVITY), *_pair(RATE), *_pair(INPUT)]
    hessian = np.zeros((len(covariance), 6, 6))
    for i in (X, Y):
        hessian[:, i, i] = -1.0
        hessian[:, 2 + i, 2 + i] = 2 * place_s2
        hessian[:, i, 4 + i] = hessian[:, 4 + i, i] = PIVOT_SIGN
    product = hessian @ covariance[:, : len(pairs), : len(pairs)]
    mean = 0.5 * np.trace(product, axis1=1, axis2=2)
    variance = 0.5 * (product * product.transpose(0, 2, 1)).sum(axis=(1, 2))
    return mean, variance


def _cosine(u: Array) -> Array:
    cosine: Array = np.sqrt(np.maximum(1 - (u * u).sum(axis=1), SMALLEST_COSINE**2))
    return cosine
