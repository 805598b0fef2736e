"""Static tilt from the specific force: the fused arctangent/arccosine algorithm of 001 and the plain forms of 003.

All functions take arrays of shape (..., 3) and return radians. They hold for static or quasi-static conditions only.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CRITICAL_VALUE = 4.0
"""CV of 001 eq. 26: the arctangent serves up to arctan(4) = 76 degrees, the arccosine beyond."""


@dataclass(frozen=True, slots=True)
class TiltAngles:
    """Angles in radians, each of the shape that the input had without its last axis."""

    pitch_rad: Array
    roll_rad: Array


def fused_tilt(m: Array, critical_value: float = CRITICAL_VALUE) -> TiltAngles:
    """Pitch alpha_5 and roll beta_5 over the full (-pi, pi] (001 eq. 16-36).

    `m` is the specific force in g, calibrated. The unfolding (31)-(36) is applied to both branches; the printed step list
    skips it after the arccosine (steps 16 and 23) and so returns 80 degrees for 100.
    """
    mx, my, mz = m[..., 0], m[..., 1], m[..., 2]
    return TiltAngles(
        pitch_rad=_fused_angle(mx, np.hypot(my, mz), mz, critical_value),
        roll_rad=_fused_angle(my, np.hypot(mx, mz), mz, critical_value),
    )


def _fused_angle(along: Array, across: Array, mz: Array, critical_value: float) -> Array:
    """One angle from its own axis and the geometric sum of the two others (001 eq. 18-36)."""
    by_arctangent = np.arctan2(along, across)  # eq. 18-19; across >= 0
    by_arccosine = np.arccos(np.minimum(across, 1.0))  # eq. 20-21
    signed = np.copysign(by_arccosine, along)  # eq. 22-25
    critical_rad = np.arctan(critical_value)  # eq. 26
    angle = np.where(by_arccosine <= critical_rad, by_arctangent, signed)  # eq. 27-30
    return np.where(mz >= 0, angle, np.copysign(np.pi, along) - angle)  # eq. 31-36


def plain_tilt(force: Array) -> TiltAngles:
    """Pitch and roll by the arctangent forms (003 eq. 6-7), within +-pi/2."""
    fx, fy, fz = force[..., 0], force[..., 1], force[..., 2]
    return TiltAngles(pitch_rad=np.arctan2(fx, np.hypot(fy, fz)), roll_rad=np.arctan2(fy, np.hypot(fx, fz)))


def axial_tilt(force: Array) -> Array:
    """Angle between the housing's z axis and the vertical, 0..pi (003 eq. 8 with the quadrant kept)."""
    return np.asarray(np.arctan2(np.hypot(force[..., 0], force[..., 1]), force[..., 2]))


def axial_tilt_uncertainty(force: Array, u_force_g: Array) -> float:
    """Standard uncertainty of the axial tilt of one reading, from that of its components, shape (3,); radians.

    First order in the plane of tilt; near zero tilt, where the direction is lost, both lateral axes count.
    """
    lateral = np.hypot(force[0], force[1])
    norm2 = float(force @ force)
    u_lateral = float(np.hypot(u_force_g[0], u_force_g[1]))
    if lateral > 3 * u_lateral:
        u_lateral = float(np.hypot(force[0] * u_force_g[0], force[1] * u_force_g[1]) / lateral)
    return float(np.hypot(force[2] * u_lateral, lateral * u_force_g[2]) / norm2)


def lean_direction(force: Array) -> Array:
    """Azimuth in the housing frame that the lower end of the housing's axis points to, from x to y, -pi..pi.

    With the housing leaning so that the load is displaced toward +x, the specific force has a negative x component.
    """
    return np.asarray(np.arctan2(-force[..., 1], -force[..., 0]))
