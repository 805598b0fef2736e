"""The ways of calibrating, as procedures that are fed readings; live sessions and the offline command build them here."""

from gateway.calibration.methods.norm_fit import FRAME_U_DEG
from gateway.calibration.methods.norm_fit import METHOD as NORM_FIT
from gateway.calibration.methods.six_position import METHOD as SIX_POSITION
from gateway.calibration.methods.six_position import PLACEMENT_U_DEG
from gateway.calibration.poses.pose_finder import NominalSensitivity
from gateway.calibration.procedures.pose_plans import NormFitPlan, SixPositionPlan
from gateway.calibration.procedures.pose_procedure import PoseProcedure
from gateway.calibration.record import CalibrationError, CalibrationRecord

METHODS = (SIX_POSITION, NORM_FIT)


def procedure_for(
    method: str,
    nominal: NominalSensitivity,
    *,
    placement_u_deg: float = PLACEMENT_U_DEG,
    frame_u_deg: float = FRAME_U_DEG,
    parent: CalibrationRecord | None = None,
) -> PoseProcedure:
    """A fresh procedure; the standard uncertainties are those of `fit_six_positions` and `fit_norm`.

    `parent` is the record in force: a norm fit, which cannot see the frame, keeps its frame.

    Raises `CalibrationError` for a method that there is not.
    """
    if method == SIX_POSITION:
        return PoseProcedure(SixPositionPlan(placement_u_deg), nominal)
    if method == NORM_FIT:
        return PoseProcedure(NormFitPlan(nominal, frame_u_deg, parent), nominal)
    raise CalibrationError(f"no method {method}; there are {', '.join(METHODS)}")
