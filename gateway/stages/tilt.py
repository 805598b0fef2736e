"""Static tilt from the specific force: fused arctangent and arccosine (Łuczak n.d.), and arctangent (Zams and Łuczak 2024).

All functions take arrays of shape (..., 3) and return radians. They are valid for static or quasi-static conditions only.
"""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array

CRITICAL_VALUE = 4.0
"""Critical value CV (Łuczak n.d., eq. 26): the arctangent is used up to arctan(4) = 76 degrees, the arccosine beyond."""


@dataclass(frozen=True, slots=True)
class TiltAngles:
    """Angles in radians, each with the shape of the input without its last axis."""

    pitch_rad: Array
    roll_rad: Array


def fused_tilt(m: Array, critical_value: float = CRITICAL_VALUE) -> TiltAngles:
    """Return pitch alpha_5 and roll beta_5 over the full range (-pi, pi] (Łuczak n.d., eq. 16 to 36).

    `m` is the calibrated specific force in g. The unfolding (eq. 31 to 36) is applied to both branches; the printed list of
    steps omits it after the arccosine (steps 16 and 23) and so returns 80 degrees for 100.
    """
    mx, my, mz = m[..., 0], m[..., 1], m[..., 2]
    return TiltAngles(
        pitch_rad=_fused_angle(mx, np.hypot(my, mz), mz, critical_value),
        roll_rad=_fused_angle(my, np.hypot(mx, mz), mz, critical_value),
    )


def _fused_angle(along: Array, across: Array, mz: Array, critical_value: float) -> Array:
    """Return one angle from its own axis and the geometric sum of the other two (Łuczak n.d., eq. 18 to 36)."""
    by_arctangent = np.arctan2(along, across)  # eq. 18-19; across >= 0
    by_arccosine = np.arccos(np.minimum(across, 1.0))  # eq. 20-21
    signed = np.copysign(by_arccosine, along)  # eq. 22-25
    critical_rad = np.arctan(critical_value)  # eq. 26
    angle = np.where(by_arccosine <= critical_rad, by_arctangent, signed)  # eq. 27-30
    return np.where(mz >= 0, angle, np.copysign(np.pi, along) - angle)  # eq. 31-36


def plain_tilt(force: Array) -> TiltAngles:
    """Return pitch and roll by the arctangent (Zams and Łuczak 2024, eq. 6 and 7), within +-pi/2."""
    fx, fy, fz = force[..., 0], force[..., 1], force[..., 2]
    return TiltAngles(pitch_rad=np.arctan2(fx, np.hypot(fy, fz)), roll_rad=np.arctan2(fy, np.hypot(fx, fz)))


def axial_tilt(force: Array) -> Array:
    """Return the angle between the z axis and the vertical, 0 to pi (Zams and Łuczak 2024, eq. 8, with the quadrant)."""
    return np.asarray(np.arctan2(np.hypot(force[..., 0], force[..., 1]), force[..., 2]))


def axial_tilt_uncertainty(force: Array, u_force_g: Array) -> float:
    """Return the standard uncertainty of the axial tilt of one reading, in radians, from that of its components, shape (3,).

    First order in the plane of tilt; near zero tilt, where the direction is not determined, both lateral axes contribute.
    """
    lateral = np.hypot(force[0], force[1])
    norm2 = float(force @ force)
    u_lateral = float(np.hypot(u_force_g[0], u_force_g[1]))
    if lateral > 3 * u_lateral:
        u_lateral = float(np.hypot(force[0] * u_force_g[0], force[1] * u_force_g[1]) / lateral)
    return float(np.hypot(force[2] * u_lateral, lateral * u_force_g[2]) / norm2)


def lean_direction(force: Array) -> Array:
    """Return the azimuth in the housing frame of the lower end of the housing's axis, from x towards y, -pi to pi.

    If the housing leans so that the load is displaced towards +x, the specific force has a negative x component.
    """
    return np.asarray(np.arctan2(-force[..., 1], -force[..., 0]))
