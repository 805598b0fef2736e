"""The part of the rope's motion that the condition stage needs, and the condition in the operator's words."""

from gateway.motion.description import engineer_reasons, operator_text
from gateway.motion.estimate import MotionEstimate
from gateway.numerics.stats import NORMAL_975
from gateway.stages.conditions.gates import MotionContext
from gateway.stages.conditions.verdict import ConditionResult
from gateway.swing.rig import MountedHousing

DISTURBED = "Reading disturbed"


def motion_context(estimate: MotionEstimate, rig: MountedHousing | None, *, is_explained: bool) -> MotionContext:
    """Return the motion as the condition stage needs it; `rig` is None where the housing's position is not known."""
    largest, length_m = estimate.last_peak, estimate.length_m
    return MotionContext(
        state=estimate.state,
        u_rad=estimate.u_rad,
        phi_max_rad=None if largest is None else largest.upper_rad(NORMAL_975),
        amplitude_rad=estimate.amplitude_rad,
        period_s=estimate.period_s,
        rho=None if rig is None or length_m is None else rig.rho_at(length_m),
        is_explained=is_explained,
        reasons=engineer_reasons(estimate),
    )


def condition_text(result: ConditionResult, estimate: MotionEstimate) -> str:
    """Return the condition as one line for the operator."""
    if result.verdict == "disturbed":
        return f"{DISTURBED}: {result.reasons[0]}."
    if result.verdict == "unknown":
        return f"Not known: {result.reasons[0]}."
    if result.verdict in ("static", "quasi_static"):
        return "Load at rest." if result.verdict == "static" else "Load at rest, with vibration."
    if estimate.state == "rest":
        return "Load almost at rest."
    return operator_text(estimate)
