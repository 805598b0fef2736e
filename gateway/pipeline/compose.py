"""Conversion of the results of the stages and of the rope's motion, in radians, to messages, in degrees."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from gateway.calibration.correction import Correction
from gateway.messages import (
    Acceleration,
    Alert,
    Calibration,
    CalibrationSession,
    Condition,
    Formulas,
    Motion,
    MotionProbabilities,
    Swing,
    Tilt,
    Validity,
)
from gateway.messages.header import Reason
from gateway.motion.description import REST_RAD, SIGNIFICANT, engineer_reasons, operator_text
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.motion.hypotheses import probabilities
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.alert_manager import AlertChange
from gateway.pipeline.incidents import IncidentRegister
from gateway.pipeline.outgoing_message import Header
from gateway.stages.condition import ConditionResult
from gateway.stages.tilt import axial_tilt, axial_tilt_uncertainty, fused_tilt, lean_direction
from gateway.swing.estimate import FormulaAngles
from gateway.units import degrees, finite

_ESTIMATED = {field.name for field in fields(MotionEstimate)} - {"probabilities", "reasons"}
_STATED = [field.name for field in fields(Motion)]
COPIED = [name for name in _STATED if name in _ESTIMATED]
"""The fields of the message that are fields of the estimate."""
ANGLES = {name: source for name in _STATED if (source := name.replace("_deg", "_rad")) in _ESTIMATED - {name}}
"""Those in degrees, with the field of the estimate in radians."""
NO_FORMULAS = Formulas(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)


def acceleration_message(header: Header, force_g: NDArray[np.float64], u_force_g: NDArray[np.float64]) -> Acceleration:
    """Return the specific force of an interval, shape (n, 3); its uncertainty is one of the axes', shape (3,)."""
    x_g, y_g, z_g = map(finite, force_g.mean(axis=0).tolist())
    x_min_g, y_min_g, z_min_g = map(finite, force_g.min(axis=0).tolist())
    x_max_g, y_max_g, z_max_g = map(finite, force_g.max(axis=0).tolist())
    return Acceleration(
        **header,
        x_g=x_g,
        y_g=y_g,
        z_g=z_g,
        x_min_g=x_min_g,
        x_max_g=x_max_g,
        y_min_g=y_min_g,
        y_max_g=y_max_g,
        z_min_g=z_min_g,
        z_max_g=z_max_g,
        u_g=finite(u_force_g.max()),
    )


def tilt_message(
    header: Header,
    lowpassed_g: NDArray[np.float64],
    u_force_g: NDArray[np.float64],
    delay_s: float,
    temperature_c: float | None,
    trusted: bool,
) -> Tilt:
    """Return the static tilt of one low-passed reading, shape (3,)."""
    angles = fused_tilt(lowpassed_g)
    return Tilt(
        **header,
        pitch_deg=degrees(angles.pitch_rad),
        roll_deg=degrees(angles.roll_rad),
        axial_deg=degrees(axial_tilt(lowpassed_g)),
        u_deg=degrees(axial_tilt_uncertainty(lowpassed_g, u_force_g)),
        direction_deg=degrees(lean_direction(lowpassed_g)),
        specific_force_g=lowpassed_g.tolist(),
        temperature_c=temperature_c,
        delay_s=delay_s,
        trusted=trusted,
    )


def condition_message(header: Header, result: ConditionResult, correction: Correction, text: str) -> Condition:
    """Return the verdict with its gates."""
    return Condition(
        **header,
        verdict=result.verdict,
        cause=result.cause,
        trusted=result.trusted,
        reasons=[str(reason) for reason in result.reasons],
        reason_codes=_codes(result.reasons),
        gates=result.gates,
        norm_g=finite(result.norm_g),
        permissible_norm_error_g=correction.permissible_norm_error_g,
        calibration=correction.status,
        text=text,
    )


def alert_message(header: Header, change: AlertChange, incidents: IncidentRegister, validity: Validity) -> Alert:
    """Return the message of a change of a rule, or of the heartbeat; `incidents` has the number of the last change."""
    stated: dict[str, Any] = {field.name: getattr(change, field.name) for field in fields(change)}
    boot_id = None if incidents.last_number is None else incidents.boot_id
    return Alert(**header, **stated, validity=validity, boot_id=boot_id, alert_number=incidents.last_number)


def calibration_message(
    header: Header, correction: Correction, info: DeviceInfo, session: CalibrationSession
) -> Calibration:
    """Return the calibration in force. The affine correction is stated even where there is no record."""
    in_force = {"gain_g_per_unit": correction.gain.tolist(), "bias_g": correction.bias_g.tolist(), "unit": info.unit}
    return Calibration(
        **header,
        status=correction.status,
        device_id=info.device_id,
        record=correction.record or {},
        in_force=in_force,
        text=correction.text,
        session=session,
    )


def motion_message(header: Header, estimate: MotionEstimate) -> Motion:
    """Return the motion at the time of the message."""
    driven, coasting, largest = estimate.next_peak, estimate.next_peak_if_coasting, estimate.last_peak
    pivot_m_s2, fast = estimate.pivot_acceleration_m_s2, estimate.fast_oscillation
    reasons = engineer_reasons(estimate)
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
        reasons=[str(reason) for reason in reasons],
        reason_codes=_codes(reasons),
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
        reasons=[str(reason) for reason in engineer_reasons(estimate)],
    )


def is_swinging(estimate: MotionEstimate) -> bool | None:
    """Return whether the swing significantly exceeds rest; None where it is not known."""
    if estimate.angle_rad is None or estimate.u_rad is None or estimate.amplitude_rad is None:
        return None
    if estimate.state == "rest":
        return False
    return bool(estimate.amplitude_rad > max(REST_RAD, SIGNIFICANT * estimate.u_rad))


def _codes(reasons: tuple[Reason, ...]) -> list[str] | None:
    return [reason.code for reason in reasons] or None


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
