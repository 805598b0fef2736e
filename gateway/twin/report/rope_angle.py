"""The rope angle that an acceleration residual is equivalent to.

A free swing of the rope's angle phi reads (1 - p/L) sin(phi) g across the rope, at a housing p below the pivot on a rope of
length L (derived from the equations of motion; exact for a fixed pivot). A residual across the rope, read as such a swing,
becomes an angle, and the angle times L a displacement of the load.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.model import TwinRig

Array = NDArray[np.float64]
MIN_TRANSVERSE_SENSITIVITY = 0.1
"""Least |1 - p/L|, in g per radian. Basis: there a position that is known to 5 % of the length makes the angle uncertain by
half."""
NOISE_DEVIATIONS = 2.0
"""A residual variance within so many standard deviations of the noise's own is no more than an upper bound."""


@dataclass(frozen=True, slots=True)
class RopeAngleError:
    """Equivalent error of a simulated rope angle, rms."""

    angle_rad: float
    displacement_m: float
    """At the load."""
    is_upper_bound: bool
    """The residual is not larger than the noise can be."""


def transverse_sensitivity(rig: TwinRig) -> float:
    """Return 1 - p/L: the reading across the rope in g per radian of a free swing."""
    return 1 - rig.position_m / rig.length_m


def rope_angle_error(residual_g: Array, rig: TwinRig) -> RopeAngleError | None:
    """Return the rope angle that a residual of x, y, z (n, 3) is equivalent to, the noise's variance subtracted.

    None where the housing is so close to the load that the transverse channels do not show the angle.
    """
    sensitivity = abs(transverse_sensitivity(rig))
    if sensitivity < MIN_TRANSVERSE_SENSITIVITY or not len(residual_g):
        return None
    variance_g2 = np.square(np.array(rig.noise_g[:2], dtype=np.float64))
    excess_g2 = float(np.square(residual_g[:, :2]).sum(axis=1).mean() - variance_g2.sum())
    bound_g2 = NOISE_DEVIATIONS * math.sqrt(2 * float(np.square(variance_g2).sum()) / len(residual_g))
    is_upper_bound = excess_g2 <= bound_g2
    transverse_g = math.sqrt(max(excess_g2, 0.0) + bound_g2 if is_upper_bound else excess_g2)
    angle_rad = math.asin(min(1.0, transverse_g / sensitivity))
    return RopeAngleError(angle_rad, rig.length_m * angle_rad, is_upper_bound)
