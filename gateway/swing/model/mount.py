"""A housing askew on its rope: rotations by two angles, about the x and the y axis of the rope's frame.

A recording is turned upright where it is not known how far the housing is askew.
"""

from dataclasses import replace

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing

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


MAX_PULL_U, MIN_PULL_U = 0.05, 0.01
"""Limits of the standard uncertainty of a side pull over the weight, where the readings may show the mount's tilt as well. Basis:
wind and a skew pull lean a load that swings freely by up to some 3 degrees."""


def turn_upright(force_g: Array, rig: MountedHousing) -> tuple[Array, MountedHousing]:
    """Return readings, shape (n, 3), whose mean is along z, and the rig of that housing; both as they are for a known mount.

    The mean shows the sum of the lean, the mount and the zero-g offset. A mount of which nothing is known is taken to be as
    uncertain as this sum is large: that two large angles cancel is not likely.
    """
    if rig.mount_u_rad == 0:
        return force_g, rig
    apparent_rad = angles_of(force_g.mean(axis=0))
    tilt_rad = float(np.hypot(*apparent_rad))
    about_x_rad, about_y_rad = (np.array(rig.mount_rad) - apparent_rad).tolist()
    upright = replace(
        rig,
        mount_rad=(about_x_rad, about_y_rad),
        mount_u_rad=tilt_rad if rig.mount_u_rad is None else rig.mount_u_rad,
        pull_u=float(np.clip(tilt_rad, MIN_PULL_U, MAX_PULL_U)),
    )
    return force_g @ rotation(apparent_rad), upright
