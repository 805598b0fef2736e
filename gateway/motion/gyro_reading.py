"""The reading of a gyroscope in the housing: the rate of the rope's direction and the spin, turned, scaled and shifted.

The housing is fixed to the rope, so that n = -e_z in its frame and n' = omega x n: with w = n' across the rope and s the rate
about it, omega = (w_y, -w_x, s). A gyroscope with scale errors e and bias b reads

    y_x = (1 + e_x) w_y + b_x        y_y = -(1 + e_y) w_x + b_y        y_z = s + b_z

This is kinematics: it holds whatever moves the pivot, blows on the load or runs the winch.
"""

from dataclasses import dataclass

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.mixture import Mixture
from gateway.motion.state_vector import GYRO_BIAS, GYRO_SCALE, N_GYRO_STATES, N_STATES, RATE, SPIN
from gateway.numerics.array import Array

BIAS_WALK_RAD_S = np.radians(1e-3)
"""Random walk of the bias, rad/s/sqrt(s): 0.01 deg/s in a hundred seconds. Basis: flicker noise of MEMS gyroscopes."""
SCALE_U = 0.02
"""Standard uncertainty of a scale error. Basis: sensitivity within 3 % and its change with temperature."""
CROSS_SHARE = 0.02
"""Error that the equations leave out, as a share of the rate. Basis: cross-axis sensitivity within 2 %, a mount of a degree."""
NOISE_FLOOR_RAD_S = np.radians(0.005)
"""Smallest standard deviation of a bin's mean. Basis: the mean over a bin is not the rate in its middle."""


@dataclass(frozen=True, slots=True)
class GyroPrior:
    """What is known of a gyroscope before its first reading."""

    bias_u_rad_s: float
    noise_rad_s: float | None = None
    """Stated, 1 sigma per sample and axis; None: to be measured."""


def with_gyro_states(mixture: Mixture, prior: GyroPrior) -> Mixture:
    """Return a mixture with the states of a gyroscope behind the others."""
    size = N_STATES + N_GYRO_STATES
    state, covariance = np.zeros((N_HYPOTHESES, size)), np.zeros((N_HYPOTHESES, size, size))
    state[:, :N_STATES], covariance[:, :N_STATES, :N_STATES] = mixture.state, mixture.covariance
    for states, sigma in ((GYRO_BIAS, prior.bias_u_rad_s), (GYRO_SCALE, SCALE_U)):
        places = list(range(states.start, states.stop))
        covariance[:, places, places] = sigma**2
    return Mixture(state, covariance, mixture.weight)


def expected_rate(x: Array) -> tuple[Array, Array]:
    """Return the reading and its derivative by x, shapes (m, 3) and (m, 3, n)."""
    w_x, w_y = x[:, RATE].T
    e_x, e_y = x[:, GYRO_SCALE].T
    reading = np.stack([(1 + e_x) * w_y, -(1 + e_y) * w_x, x[:, SPIN]], axis=1) + x[:, GYRO_BIAS]
    jacobian = np.zeros((len(x), 3, x.shape[1]))
    jacobian[:, 0, RATE.start + 1], jacobian[:, 1, RATE.start] = 1 + e_x, -(1 + e_y)
    jacobian[:, 0, GYRO_SCALE.start], jacobian[:, 1, GYRO_SCALE.start + 1] = w_y, -w_x
    jacobian[:, 2, SPIN] = 1.0
    for axis in range(3):
        jacobian[:, axis, GYRO_BIAS.start + axis] = 1.0
    return reading, jacobian


def rate_variance(rate_rad_s: Array, bias_rad_s: Array, sigma_rad_s: Array) -> Array:
    """Return the variance of a reading's error, shape (m, 3): its noise, and a share of what the equations simplify."""
    turning = rate_rad_s - bias_rad_s
    share = CROSS_SHARE**2 * np.vecdot(turning, turning)
    variance: Array = np.square(sigma_rad_s) + NOISE_FLOOR_RAD_S**2 + share[:, None]
    return variance
