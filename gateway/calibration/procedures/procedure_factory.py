"""Makes the procedure of a method, for live sessions and for offline calibration."""

from gateway.calibration.methods.norm_fit import FRAME_U_DEG
from gateway.calibration.methods.six_position import PLACEMENT_U_DEG
from gateway.calibration.pose_method import PoseMethod
from gateway.calibration.poses.nominal_sensitivity import NominalSensitivity
from gateway.calibration.procedures.pose_plans import NormFitPlan, SixPositionPlan
from gateway.calibration.procedures.pose_procedure import PoseProcedure
from gateway.calibration.record import CalibrationError, CalibrationRecord


def make_procedure(
    method: str,
    nominal: NominalSensitivity,
    *,
    placement_u_deg: float = PLACEMENT_U_DEG,
    frame_u_deg: float = FRAME_U_DEG,
    parent: CalibrationRecord | None = None,
) -> PoseProcedure:
    """Return a new procedure; the standard uncertainties are those of `fit_six_positions` and `fit_norm`.

    `parent` is the record in force, whose reference frame a norm fit keeps. Raises `CalibrationError` for an unknown method.
    """
    match method:
        case PoseMethod.SIX_POSITION:
            return PoseProcedure(SixPositionPlan(placement_u_deg), nominal)
        case PoseMethod.NORM_FIT:
            return PoseProcedure(NormFitPlan(nominal, frame_u_deg, parent), nominal)
        case _:
            raise CalibrationError(f"no method {method}; there are {', '.join(PoseMethod)}")
