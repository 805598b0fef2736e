"""The error of the stated rope length by the period of the swing, from which a fit of the length starts."""

from gateway.swing.detection.rope_length import rope_length_by_period
from gateway.twin.effects.rope import RopeLength
from gateway.twin.reconcile.fit.fit_context import FitContext


def length_error_by_period(setting: FitContext) -> float | None:
    """Return the relative error of the rope's length where the period, at its amplitude, contradicts the rig; else None."""
    if RopeLength.name in setting.model_effects:
        return None
    rig, log = setting.rig, setting.log
    by_period = rope_length_by_period(log.time_s, log.force_g, rig.gravity_m_s2)
    if by_period is None:
        return None
    error = by_period.length_m / rig.length_m - 1
    return error if abs(error) >= by_period.u_rel else None
