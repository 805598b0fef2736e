"""Static tilt from the specific force: fused arctangent and arccosine (Łuczak n.d.), and arctangent (Zams and Łuczak 2024).

All functions take one reading, shape (3,), and return radians. They are valid for static or quasi-static conditions only.
"""

import math
from dataclasses import dataclass

from gateway.numerics.array import Array

CRITICAL_VALUE = 4.0
"""Critical value CV (Łuczak n.d., eq. 26): the arctangent is used up to arctan(4) = 76 degrees, the arccosine beyond."""

LEAST_COSINE = 1e-12
"""Cosine of a pitch that leaves no roll. Basis: that of a right angle in floating point is 6e-17."""


@dataclass(frozen=True, slots=True)
class TiltAngles:
    """Angles in radians."""

    pitch_rad: float
    roll_rad: float


def fused_tilt(m: Array, critical_value: float = CRITICAL_VALUE) -> TiltAngles:
    """Return pitch alpha_5 and roll beta_5 over the full range (-pi, pi] (Łuczak n.d., eq. 16 to 36).

    `m` is the calibrated specific force in g. The unfolding (eq. 31 to 36) is applied to both branches; the printed list of
    steps omits it after the arccosine (steps 16 and 23) and so returns 80 degrees for 100.
    """
    mx, my, mz = m.tolist()
    return TiltAngles(
        pitch_rad=_fused_angle(mx, math.hypot(my, mz), mz, critical_value),  # eq. 16-17
        roll_rad=_fused_angle(my, math.hypot(mx, mz), mz, critical_value),  # eq. 16-17
    )


def _fused_angle(along: float, across: float, mz: float, critical_value: float) -> float:
    """Return one angle from its own axis and the geometric sum of the other two (Łuczak n.d., eq. 18 to 36)."""
    by_arctangent = math.atan2(along, across)  # eq. 18-19; across >= 0
    by_arccosine = math.acos(min(across, 1.0))  # eq. 20-21
    signed = math.copysign(by_arccosine, along)  # eq. 22-25
    critical_rad = math.atan(critical_value)  # eq. 26
    angle = by_arctangent if by_arccosine <= critical_rad else signed  # eq. 27-30
    return angle if mz >= 0 else math.copysign(math.pi, along) - angle  # eq. 31-36


def plain_tilt(force: Array) -> TiltAngles:
    """Return pitch alpha and roll beta by the arctangent, within +-pi/2 (Łuczak n.d., eq. 3 and 4; Zhu et al. 2020, eq. 1, 2).

    Beta is the angle of the y axis to the level. The roll gamma about the x axis differs from it where there is pitch: see
    `roll_about_x`.
    """
    fx, fy, fz = force.tolist()
    return TiltAngles(pitch_rad=math.atan2(fx, math.hypot(fy, fz)), roll_rad=math.atan2(fy, math.hypot(fx, fz)))


def roll_about_x(force: Array) -> float:
    """Return the roll gamma about the x axis, -pi to pi (Łuczak n.d., eq. 7; Zams and Łuczak 2024, eq. 7, with the quadrant).

    NaN where x is vertical, which leaves no roll.
    """
    _, fy, fz = force.tolist()
    return math.atan2(fy, fz) if fy or fz else math.nan


def roll_from_angles(beta_rad: float, alpha_rad: float) -> float:
    """Return the roll gamma within +-pi/2 from beta and pitch (Łuczak n.d., eq. 8); NaN where pitch leaves no roll."""
    cosine = math.cos(alpha_rad)
    if abs(cosine) < LEAST_COSINE:
        return math.nan
    return math.asin(max(-1.0, min(1.0, math.sin(beta_rad) / cosine)))


def axial_tilt(force: Array) -> float:
    """Return the angle between the z axis and the vertical, 0 to pi (Zams and Łuczak 2024, eq. 8, with the quadrant)."""
    fx, fy, fz = force.tolist()
    return math.atan2(math.hypot(fx, fy), fz)


def axial_tilt_uncertainty(force: Array, u_force_g: Array) -> float:
    """Return the standard uncertainty of the axial tilt, in radians, from that of the components of the reading, shape (3,).

    First order in the plane of tilt; near zero tilt, where the direction is not determined, both lateral axes contribute. NaN
    for a reading of zero, which has no direction.
    """
    fx, fy, fz = force.tolist()
    ux, uy, uz = u_force_g.tolist()
    norm2: float = fx * fx + fy * fy + fz * fz
    if norm2 == 0:
        return math.nan
    lateral, u_lateral = math.hypot(fx, fy), math.hypot(ux, uy)
    if lateral > 3 * u_lateral:
        u_lateral = math.hypot(fx * ux, fy * uy) / lateral
    return math.hypot(fz * u_lateral, lateral * uz) / norm2


def lean_direction(force: Array) -> float:
    """Return the azimuth in the housing frame of the lower end of the housing's axis, from x towards y, -pi to pi.

    If the housing leans so that the load is displaced towards +x, the specific force has a negative x component.
    """
    fx, fy, _ = force.tolist()
    return math.atan2(-fy, -fx)
