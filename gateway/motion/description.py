"""What crane and load do, by the probabilities of the hypotheses, and the motion in words for operator and engineer."""

import numpy as np

from gateway.messages.header import Reason
from gateway.motion.estimate import MotionEstimate, MotionState
from gateway.motion.hypotheses import probabilities
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975

REST_RAD = np.radians(0.15)
"""Amplitude below which a load rests."""
LARGEST_REST_RAD = np.radians(1.0)
"""Amplitude from which on a load is not said to rest, however uncertain it is. Basis: what an operator sees."""
SIGNIFICANT = 3.0
"""Standard uncertainties."""
DISTINCT = 2.45
"""Standard uncertainties by which a horizontal vector differs from zero. Definition: noise of two axes is longer in 5 %."""
SLOWEST_HOIST_M_S = 0.02
LIKELY = 0.5
"""Definition: the more probable of two."""


def motion_state(
    weight: Array, amplitude: float, u_amplitude: float, speed_m_s: float, speed_u_m_s: float
) -> MotionState:
    """Return the state; `amplitude` of the swing, rad, and `speed_m_s` of the hoist with their standard uncertainties."""
    driven, gust, hoisting = probabilities(weight)
    if driven > LIKELY:
        return "driven"
    if hoisting > LIKELY and abs(speed_m_s) > max(SIGNIFICANT * speed_u_m_s, SLOWEST_HOIST_M_S):
        return "hoisting"
    if gust > LIKELY:
        return "wind"
    return "rest" if amplitude < max(REST_RAD, min(SIGNIFICANT * u_amplitude, LARGEST_REST_RAD)) else "free"


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


def is_cause_distinct(estimate: MotionEstimate) -> bool:
    """Return whether what acts by the state of the motion, if anything does, is distinguishable from nothing."""
    if estimate.state == "driven" and estimate.pivot_acceleration_m_s2 is not None:
        size, u = float(np.hypot(*estimate.pivot_acceleration_m_s2)), estimate.pivot_acceleration_u_m_s2
    elif estimate.state == "wind":
        size, u = estimate.push or 0.0, estimate.push_u
    else:
        return True
    return u is None or size > DISTINCT * u


def engineer_reasons(estimate: MotionEstimate) -> tuple[Reason, ...]:
    """Return what acts, with numbers, before the reasons of the estimate itself."""
    return (*_drive(estimate), *_fast_oscillation(estimate), *_askew(estimate), *estimate.reasons)


def _what_acts(estimate: MotionEstimate) -> str:
    if estimate.state == "hoisting":
        return "Lowering" if (estimate.hoist_m_s or 0.0) > 0 else "Hoisting"
    return STATE_TEXTS[estimate.state]


def _drive(estimate: MotionEstimate) -> tuple[Reason, ...]:
    may = "" if is_cause_distinct(estimate) else "perhaps "
    if estimate.state == "driven" and estimate.pivot_acceleration_m_s2 is not None:
        size_m_s2, u_m_s2 = float(np.hypot(*estimate.pivot_acceleration_m_s2)), estimate.pivot_acceleration_u_m_s2
        words = f"{may}the pivot accelerates by {size_m_s2:.2f} m/s^2 (u {u_m_s2:.2f})"
        return (Reason("pivot_accelerates", words),)
    if estimate.state == "hoisting" and estimate.hoist_m_s is not None:
        words = f"the rope's length changes by {estimate.hoist_m_s:+.2f} m/s (u {estimate.hoist_u_m_s:.2f})"
        return (Reason("rope_length_changes", words),)
    if estimate.state == "wind":
        return (Reason("wind", f"{may}a force pushes the load, and the pivot rests"),)
    return ()


def _fast_oscillation(estimate: MotionEstimate) -> tuple[Reason, ...]:
    found = estimate.fast_oscillation
    if found is None or found.angle_rad < NOTABLE_OSCILLATION_RAD:
        return ()
    words = (
        f"an oscillation at {found.frequency_hz:.2f} Hz, {np.degrees(found.angle_rad):.2f} deg of the rope's angle: "
        "a load that swings under its hook, or a rope that vibrates"
    )
    return (Reason("fast_oscillation", words),)


def _askew(estimate: MotionEstimate) -> tuple[Reason, ...]:
    mount_rad, u_rad = estimate.mount_rad, estimate.mount_u_rad
    if mount_rad is None or u_rad is None or mount_rad - 2 * NORMAL_975 * u_rad < ASKEW_RAD:
        return ()
    words = (
        f"the housing stands {np.degrees(mount_rad):.1f} deg askew on the rope (u {np.degrees(u_rad):.1f}): "
        "mount it again, or zero it"
    )
    return (Reason("askew", words),)
