"""A housing askew on its rope: rotations by two angles, about the x and the y axis of the rope's frame."""

import numpy as np

from gateway.numerics.array import Array

DERIVATIVE_STEP_RAD = 1e-5
"""Step of the central differences. Definition: truncation and rounding errors are both 1e-10 or less."""


def rotation(angles_rad: Array) -> Array:
    """Return R_housing_from_rope, shape (3, 3), of the rotation vector (about x, about y, 0)."""
    about_x, about_y = angles_rad.tolist()
    cross = np.array([[0.0, 0.0, about_y], [0.0, 0.0, -about_x], [-about_y, about_x, 0.0]])
    angle = float(np.hypot(about_x, about_y))
    turned: Array = np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
    return turned


def rotation_derivatives(angles_rad: Array) -> Array:
    """Return the derivatives of the rotation by its two angles, shape (2, 3, 3)."""
    steps = DERIVATIVE_STEP_RAD * np.eye(2)
    differences = [rotation(angles_rad + step) - rotation(angles_rad - step) for step in steps]
    return np.array(differences) / (2 * DERIVATIVE_STEP_RAD)


def angles_of(direction: Array) -> Array:
    """Return the two angles that rotate z into a direction, shape (3,) of any length."""
    x, y, z = direction.tolist()
    across = float(np.hypot(x, y))
    angle = float(np.arctan2(across, z))
    return np.array([-y, x]) * (angle / across) if across > 0 else np.zeros(2)
