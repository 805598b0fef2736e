"""A recording turned upright, where it is not known how far the housing is askew on the rope."""

from dataclasses import replace

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.model.mount import angles_of, rotation
from gateway.swing.rig import MountedHousing

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
