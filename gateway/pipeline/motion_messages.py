"""Conversion of the rope's motion, in radians, to the messages of motion and swing, in degrees."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from gateway.messages import Formulas, Motion, MotionProbabilities, Swing
from gateway.motion.description import engineer_reasons, operator_text
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.motion.hypotheses import probabilities
from gateway.motion.motion_state import REST_RAD, SIGNIFICANT
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.header import Header
from gateway.swing.estimate import FormulaAngles
from gateway.units import degrees

_ESTIMATED = {field.name for field in fields(MotionEstimate)} - {"probabilities", "reasons"}
_STATED = [field.name for field in fields(Motion)]
COPIED = [name for name in _STATED if name in _ESTIMATED]
"""The fields of the message that are fields of the estimate."""
ANGLES = {name: source for name in _STATED if (source := name.replace("_deg", "_rad")) in _ESTIMATED - {name}}
"""Those in degrees, with the field of the estimate in radians."""
NO_FORMULAS = Formulas(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)


def motion_message(header: Header, estimate: MotionEstimate) -> Motion:
    """Return the motion at the time of the message."""
    driven, coasting, largest = estimate.next_peak, estimate.next_peak_if_coasting, estimate.last_peak
    pivot_m_s2, fast = estimate.pivot_acceleration_m_s2, estimate.fast_oscillation
    known: dict[str, Any] = {name: getattr(estimate, name) for name in COPIED}
    known |= {name: degrees(getattr(estimate, source)) for name, source in ANGLES.items()}
    return Motion(
        **header,
        **known,
        pivot_accel_m_s2=None if pivot_m_s2 is None else list(pivot_m_s2),
        pivot_accel_u_m_s2=estimate.pivot_acceleration_u_m_s2,
        phi_max_deg=_angle_deg(largest),
        phi_max_u_deg=_u_deg(largest),
        predicted_phi_max_deg=_angle_deg(driven),
        predicted_u_deg=_u_deg(driven),
        time_to_peak_s=None if driven is None else driven.in_s,
        coasting_phi_max_deg=_angle_deg(coasting),
        coasting_u_deg=_u_deg(coasting),
        coasting_time_to_peak_s=None if coasting is None else coasting.in_s,
        probabilities=_probabilities(estimate.probabilities),
        fast_oscillation_hz=None if fast is None else fast.frequency_hz,
        fast_oscillation_deg=None if fast is None else degrees(fast.angle_rad),
        reasons=list(engineer_reasons(estimate)),
        text=operator_text(estimate),
    )


def swing_message(header: Header, estimate: MotionEstimate, formulas: FormulaAngles | None) -> Swing:
    """Return the swing of the last period, with the published formulas over it; where it is not known, the reasons."""
    swing, coming = estimate.last_peak, estimate.expected_peak
    return Swing(
        **header,
        swinging=is_swinging(estimate),
        phi_max_deg=_angle_deg(swing),
        u_deg=_u_deg(swing),
        coverage95_deg=None if swing is None else _coverage95_deg(swing),
        minor_phi_max_deg=degrees(estimate.minor_amplitude_rad),
        azimuth_deg=degrees(estimate.major_azimuth_rad),
        lean_deg=degrees(estimate.lean_rad),
        lean_azimuth_deg=degrees(estimate.lean_azimuth_rad),
        period_s=estimate.period_s,
        predicted_phi_max_deg=_angle_deg(coming),
        predicted_u_deg=_u_deg(coming),
        time_to_peak_s=None if coming is None else coming.in_s,
        formulas_deg=NO_FORMULAS if formulas is None else _formulas(formulas),
        reasons=list(engineer_reasons(estimate)),
    )


def is_swinging(estimate: MotionEstimate) -> bool | None:
    """Return whether the swing significantly exceeds rest; None where it is not known."""
    if estimate.angle_rad is None or estimate.u_rad is None or estimate.amplitude_rad is None:
        return None
    if estimate.state == "rest":
        return False
    return bool(estimate.amplitude_rad > max(REST_RAD, SIGNIFICANT * estimate.u_rad))


def _angle_deg(peak: PeakEstimate | None) -> float | None:
    return None if peak is None else degrees(peak.angle_rad)


def _u_deg(peak: PeakEstimate | None) -> float | None:
    return None if peak is None else degrees(peak.u_rad)


def _coverage95_deg(peak: PeakEstimate) -> list[float]:
    low_rad = max(0.0, peak.angle_rad - NORMAL_975 * peak.u_rad)
    return [float(np.degrees(low_rad)), float(np.degrees(peak.upper_rad(NORMAL_975)))]


def _probabilities(values: tuple[float, ...]) -> MotionProbabilities | None:
    if not values:
        return None
    driven, wind, hoisting = probabilities(np.array(values))
    return MotionProbabilities(free=max(0.0, 1 - driven - wind), driven=driven, wind=wind, hoisting=hoisting)


def _formulas(angles: FormulaAngles) -> Formulas:
    return Formulas(**{name: degrees(angle_rad) for name, angle_rad in asdict(angles).items()})
