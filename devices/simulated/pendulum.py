"""The one statement of the equations of motion of a load on a rope, free of singularities.

World frame: z up. n is the unit vector from the pivot to the load. The housing's z axis is -n (along the rope, toward the
pivot); it does not turn about the rope, so its x axis is carried along by parallel transport. A motion is an array of shape
(..., 3, 3) whose rows are n, n' in 1/s, and the housing's x axis; leading dimensions are independent motions.

Derived from Newton's law for a point load on a rope of length L(t) whose pivot accelerates by a_p, other forces F:

    n'' = (I - n n^T)(g - a_p + F/m)/L - 2 (L'/L) n' - |n'|^2 n
    f   = a_p + r n'' + 2 r' n' + r'' n - g                       specific force at distance r from the pivot
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STANDARD_GRAVITY_M_S2 = 9.80665


def dot(a: Array, b: Array) -> Array:
    """Scalar product over the last axis, which is kept with length 1."""
    product: Array = np.einsum("...i,...i->...", a, b)[..., None]
    return product


def acceleration_of_direction(
    n: Array, n_rate: Array, drive_m_s2: Array, length_m: Array | float, length_rate_m_s: Array | float
) -> Array:
    """n'' in 1/s^2, shape (..., 3); `drive_m_s2` is g - a_p + F/m, lengths of shape (..., 1) or scalar."""
    transverse = drive_m_s2 - dot(n, drive_m_s2) * n
    return (transverse - 2 * length_rate_m_s * n_rate) / length_m - dot(n_rate, n_rate) * n


def motion_rate(motion: Array, drive_m_s2: Array, length_m: Array | float, length_rate_m_s: Array | float) -> Array:
    """Time derivative of a motion, shape (..., 3, 3)."""
    n, n_rate, x_axis = motion[..., 0, :], motion[..., 1, :], motion[..., 2, :]
    rate = np.empty_like(motion)
    rate[..., 0, :] = n_rate
    rate[..., 1, :] = acceleration_of_direction(n, n_rate, drive_m_s2, length_m, length_rate_m_s)
    rate[..., 2, :] = -dot(x_axis, n_rate) * n  # parallel transport: no angular velocity along n
    return rate


def runge_kutta_step(rate: Callable[[float, Array], Array], time_s: float, motion: Array, step_s: float) -> Array:
    """One classical fourth-order step of `rate(time_s, motion)`."""
    k1 = rate(time_s, motion)
    k2 = rate(time_s + step_s / 2, motion + step_s / 2 * k1)
    k3 = rate(time_s + step_s / 2, motion + step_s / 2 * k2)
    k4 = rate(time_s + step_s, motion + step_s * k3)
    return motion + step_s / 6 * (k1 + 2 * (k2 + k3) + k4)


def housing_axes(motion: Array) -> Array:
    """R_housing_from_world, shape (..., 3, 3): rows are the housing's x, y and z axes in the world."""
    z_axis = -motion[..., 0, :]
    x_axis = motion[..., 2, :]
    return np.stack([x_axis, np.cross(z_axis, x_axis), z_axis], axis=-2)


def specific_force_m_s2(
    motion: Array,
    n_acceleration: Array,
    pivot_acceleration_m_s2: Array,
    gravity_m_s2: float,
    position_m: Array | float,
    position_rate_m_s: Array | float = 0.0,
    position_acceleration_m_s2: Array | float = 0.0,
) -> Array:
    """Specific force at the housing in the housing's frame, shape (..., 3); positions of shape (..., 1) or scalar."""
    n, n_rate = motion[..., 0, :], motion[..., 1, :]
    force = (
        pivot_acceleration_m_s2
        + position_m * n_acceleration
        + 2 * position_rate_m_s * n_rate
        + position_acceleration_m_s2 * n
    )
    force = force + np.array([0.0, 0.0, gravity_m_s2])
    in_housing: Array = np.einsum("...ij,...j->...i", housing_axes(motion), force)
    return in_housing


def start_motion(tilt_x_rad: float, tilt_y_rad: float, rate_x_rad_s: float, rate_y_rad_s: float) -> Array:
    """A motion from the rope's lean toward world x and y and its rates; the housing's x axis starts nearest to world x."""
    n = np.array(
        [np.sin(tilt_x_rad) * np.cos(tilt_y_rad), np.sin(tilt_y_rad), -np.cos(tilt_x_rad) * np.cos(tilt_y_rad)]
    )
    by_x = np.array([np.cos(tilt_x_rad) * np.cos(tilt_y_rad), 0.0, np.sin(tilt_x_rad) * np.cos(tilt_y_rad)])
    by_y = np.array(
        [-np.sin(tilt_x_rad) * np.sin(tilt_y_rad), np.cos(tilt_y_rad), np.cos(tilt_x_rad) * np.sin(tilt_y_rad)]
    )
    x_axis = np.array([1.0, 0.0, 0.0]) - n[0] * n
    return np.stack([n, rate_x_rad_s * by_x + rate_y_rad_s * by_y, x_axis / np.linalg.norm(x_axis)])
