"""Motions of a load on a rope as arrays, around the one statement of the equations in `devices.pendulum.equations`.

A motion is an array of shape (..., 3, 3) whose rows are n, n' in 1/s, and the housing's x axis; leading dimensions are
independent motions. World frame: z up; n is the unit vector from the pivot to the load, the housing's z axis is -n.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from devices.pendulum import equations
from devices.pendulum.equations import Scalar, Vector

Array = NDArray[np.float64]


def acceleration_of_direction(
    n: Array, n_rate: Array, drive_m_s2: Array, length_m: Array | float, length_rate_m_s: Array | float
) -> Array:
    """n'' in 1/s^2, shape (..., 3); `drive_m_s2` is g - a_p + F/m, lengths of shape (..., 1) or scalar."""
    return _array(
        equations.acceleration_of_direction(
            _components(n), _components(n_rate), _components(drive_m_s2), _one(length_m), _one(length_rate_m_s)
        )
    )


def motion_rate(motion: Array, drive_m_s2: Array, length_m: Array | float, length_rate_m_s: Array | float) -> Array:
    """Time derivative of a motion, shape (..., 3, 3)."""
    n, n_rate, x_axis = motion[..., 0, :], motion[..., 1, :], motion[..., 2, :]
    rate = np.empty_like(motion)
    rate[..., 0, :] = n_rate
    rate[..., 1, :] = acceleration_of_direction(n, n_rate, drive_m_s2, length_m, length_rate_m_s)
    rate[..., 2, :] = _array(equations.transport_rate(_components(n), _components(n_rate), _components(x_axis)))
    return rate


def runge_kutta_step(
    rate: Callable[[float, Array], Array], time_s: float, motion: Array, step_s: float, k1: Array | None = None
) -> Array:
    """One classical fourth-order step of `rate(time_s, motion)`; `k1` is the rate at its start where that is known."""
    k1 = rate(time_s, motion) if k1 is None else k1
    k2 = rate(time_s + step_s / 2, motion + step_s / 2 * k1)
    k3 = rate(time_s + step_s / 2, motion + step_s / 2 * k2)
    k4 = rate(time_s + step_s, motion + step_s * k3)
    return motion + step_s / 6 * (k1 + 2 * (k2 + k3) + k4)


def housing_axes(motion: Array) -> Array:
    """R_housing_from_world, shape (..., 3, 3): rows are the housing's x, y and z axes in the world."""
    z_axis = -motion[..., 0, :]
    x_axis = motion[..., 2, :]
    y_axis = _array(equations.cross(_components(z_axis), _components(x_axis)))
    return np.stack([x_axis, y_axis, z_axis], axis=-2)


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
    n, n_rate, x_axis = (_components(motion[..., row, :]) for row in range(3))
    force = equations.specific_force(
        n,
        n_rate,
        _components(n_acceleration),
        _components(pivot_acceleration_m_s2),
        gravity_m_s2,
        _one(position_m),
        _one(position_rate_m_s),
        _one(position_acceleration_m_s2),
    )
    return _array(equations.in_housing(n, x_axis, force))


def start_motion(tilt_x_rad: float, tilt_y_rad: float, rate_x_rad_s: float, rate_y_rad_s: float) -> Array:
    """A motion from the rope's lean toward world x and y and its rates; the housing's x axis starts nearest to world x."""
    turns = (math.sin(tilt_x_rad), math.cos(tilt_x_rad), math.sin(tilt_y_rad), math.cos(tilt_y_rad))
    n = equations.direction(*turns)
    by_x, by_y = equations.direction_by_tilts(*turns)
    n_rate = equations.add(equations.scale(rate_x_rad_s, by_x), equations.scale(rate_y_rad_s, by_y))
    x_axis = equations.reference_axis(n, math.sqrt(1 - n[0] * n[0]))
    return np.array([n, n_rate, x_axis])


def _components(vectors: Array) -> Vector:
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _array(vector: Vector) -> Array:
    return np.stack(np.broadcast_arrays(*vector), axis=-1)


def _one(scalars: Array | float) -> Scalar:
    """Of shape (...): what stood beside vectors with a last axis of length 1."""
    return scalars[..., 0] if isinstance(scalars, np.ndarray) and scalars.ndim else scalars
