"""The motion in words: a sentence for the operator, and reasons for the engineer."""

import numpy as np

from gateway.motion.estimate import MotionEstimate
from gateway.numerics.stats import NORMAL_975

STATE_TEXTS = {"free": "Free swing", "driven": "Trolley moving", "wind": "Wind gust"}
NOTABLE_OSCILLATION_RAD = np.radians(0.05)
"""Share of a fast oscillation in the rope's angle that is worth a word. Basis: half of the last digit of the operator's text."""

ASKEW_RAD = np.radians(3.0)
"""Angle between housing and rope that is worth a word. Basis: five times what a clamp by eye leaves."""


def operator_text(estimate: MotionEstimate) -> str:
    """Return one line for the operator; the interval is that of 95 %."""
    if estimate.angle_rad is None:
        return f"Swing not known: {estimate.reasons[0] if estimate.reasons else 'no reason given'}."
    if estimate.state == "rest":
        return "Load at rest."
    swing = estimate.last_peak
    if swing is None:
        return f"{_what_acts(estimate)}."
    angle_deg, half_width_deg = np.degrees(swing.angle_rad), np.degrees(NORMAL_975 * swing.u_rad)
    interval = f"{angle_deg:.1f}° ± {max(half_width_deg, 0.1):.1f}°"
    return (
        f"{_what_acts(estimate)} {interval}."
        if estimate.state == "free"
        else f"{_what_acts(estimate)}. Swing {interval}."
    )


def engineer_reasons(estimate: MotionEstimate) -> tuple[str, ...]:
    """Return what acts, with numbers, before the reasons of the estimate itself."""
    return (*_drive(estimate), *_fast_oscillation(estimate), *_askew(estimate), *estimate.reasons)


def _what_acts(estimate: MotionEstimate) -> str:
    if estimate.state == "hoisting":
        return "Lowering" if (estimate.hoist_m_s or 0.0) > 0 else "Hoisting"
    return STATE_TEXTS[estimate.state]


def _drive(estimate: MotionEstimate) -> tuple[str, ...]:
    if estimate.state == "driven" and estimate.pivot_acceleration_m_s2 is not None:
        size_m_s2, u_m_s2 = float(np.hypot(*estimate.pivot_acceleration_m_s2)), estimate.pivot_acceleration_u_m_s2
        return (f"the pivot accelerates by {size_m_s2:.2f} m/s^2 (u {u_m_s2:.2f})",)
    if estimate.state == "hoisting" and estimate.hoist_m_s is not None:
        return (f"the rope's length changes by {estimate.hoist_m_s:+.2f} m/s (u {estimate.hoist_u_m_s:.2f})",)
    if estimate.state == "wind":
        return ("a force pushes the load, and the pivot rests",)
    return ()


def _fast_oscillation(estimate: MotionEstimate) -> tuple[str, ...]:
    found = estimate.fast_oscillation
    if found is None or found.angle_rad < NOTABLE_OSCILLATION_RAD:
        return ()
    return (
        f"an oscillation at {found.frequency_hz:.2f} Hz, {np.degrees(found.angle_rad):.2f} deg of the rope's angle: "
        "a load that swings under its hook, or a rope that vibrates",
    )


def _askew(estimate: MotionEstimate) -> tuple[str, ...]:
    mount_rad, u_rad = estimate.mount_rad, estimate.mount_u_rad
    if mount_rad is None or u_rad is None or mount_rad - 2 * NORMAL_975 * u_rad < ASKEW_RAD:
        return ()
    return (
        f"the housing stands {np.degrees(mount_rad):.1f} deg askew on the rope (u {np.degrees(u_rad):.1f}): "
        "mount it again, or zero it",
    )
