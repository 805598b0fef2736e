"""Conversion of the stages' results, in radians, to messages, in degrees."""

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from gateway.calibration.correction import Correction
from gateway.messages import Acceleration, Alert, Calibration, CalibrationSession, Condition, Tilt, Validity
from gateway.pipeline.alert_manager import AlertChange
from gateway.pipeline.header import Header
from gateway.pipeline.incidents import IncidentRegister
from gateway.stages.conditions.verdict import ConditionResult
from gateway.stages.tilt import axial_tilt, axial_tilt_uncertainty, fused_tilt, lean_direction
from gateway.units import degrees, finite


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
        reasons=list(result.reasons),
        gates=result.gates,
        norm_g=finite(result.norm_g),
        permissible_norm_error_g=correction.permissible_norm_error_g,
        calibration=correction.status,
        text=text,
    )


def alert_message(header: Header, change: AlertChange, incidents: IncidentRegister, validity: Validity) -> Alert:
    """Return the message of a change of a rule, or of the heartbeat; `incidents` has the number of the last change."""
    return Alert(
        **header,
        level=change.level,
        validity=validity,
        event=change.event,
        boot_id=None if incidents.last_number is None else incidents.boot_id,
        alert_number=incidents.last_number,
        rule=change.rule,
        incident=change.incident,
        limit_deg=change.limit_deg,
        clear_deg=change.clear_deg,
        largest_deg=change.largest_deg,
        largest_upper_deg=change.largest_upper_deg,
        acknowledged_by=change.acknowledged_by,
        reason=change.reason,
        change=change.line,
        active=change.active,
        text=change.text,
    )


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
