"""Which poses the methods want: six faces in any order, or directions all round."""

from dataclasses import replace

import numpy as np

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.experiment_design import CONDITION_LIMIT, conditioning, next_direction
from gateway.calibration.methods.norm_fit import METHOD as NORM_FIT
from gateway.calibration.methods.norm_fit import NEEDED, fit_norm
from gateway.calibration.methods.six_position import METHOD as SIX_POSITION
from gateway.calibration.methods.six_position import fit_six_positions, missing_faces
from gateway.calibration.poses.faces import FACE_DIRECTIONS, FACES, direction_text, face_of, off_face_deg
from gateway.calibration.poses.pose import Pose
from gateway.calibration.poses.pose_finder import TURN_LIMIT_G, NominalSensitivity
from gateway.calibration.procedures.pose_procedure import Poses, RequestedPose
from gateway.calibration.record import CalibrationRecord

NORM_FIT_WANTED = NEEDED + 3
"""Some more than the unknowns, so that the fit is checked."""


class SixPositionPlan:
    """Each face up once at least; the same face again is a repeat and averaged."""

    method = SIX_POSITION
    wanted = len(FACES)

    def __init__(self, placement_u_deg: float) -> None:
        self._placement_u_deg = placement_u_deg

    def receive(self, pose: Pose, earlier: Poses) -> tuple[Pose | None, str]:
        """Every pose is kept; one on no face is marked as not used."""
        if pose.face is None:
            off_deg = off_face_deg(np.array(pose.mean))
            return replace(pose, used=False), f"{off_deg:.0f} deg off the nearest face: not used; lay it on a face"
        count = 1 + sum(one.face == pose.face for one in earlier)
        return pose, f"{pose.face} taken" + (f" again: {count} are averaged" if count > 1 else "")

    def next(self, poses: Poses) -> RequestedPose:
        """The first missing face."""
        missing = missing_faces(poses)
        if not missing:
            return RequestedPose(None, None, "all six faces are taken")
        return RequestedPose(
            missing[0], FACE_DIRECTIONS[missing[0]], f"next: {missing[0]} up; missing: {', '.join(missing)}"
        )

    def fit(self, poses: Poses) -> CalibrationFit:
        """See `fit_six_positions`."""
        return fit_six_positions(poses, self._placement_u_deg)


class NormFitPlan:
    """Poses all round; one too near an earlier one adds nothing and is refused."""

    method = NORM_FIT
    wanted = NORM_FIT_WANTED

    def __init__(self, nominal: NominalSensitivity, frame_u_deg: float, parent: CalibrationRecord | None) -> None:
        self._nominal = nominal
        self._frame_u_deg = frame_u_deg
        self._parent = parent

    def receive(self, pose: Pose, earlier: Poses) -> tuple[Pose | None, str]:
        """Refused within about 15 degrees of an earlier one; offsets cancel in the difference of two readings."""
        limit = TURN_LIMIT_G * self._nominal.units_per_g
        for number, one in enumerate(earlier, start=1):
            if np.linalg.norm(np.subtract(pose.mean, one.mean)) < limit:
                return None, f"too near pose {number}: adds nothing, not used; turn it further"
        return pose, f"pose {len(earlier) + 1} taken"

    def next(self, poses: Poses) -> RequestedPose:
        """The direction that helps most."""
        readings = np.array([self._nominal.in_g(pose.mean) for pose in poses]).reshape(-1, 3)
        up = readings / np.linalg.norm(readings, axis=1, keepdims=True)
        if len(up) >= NORM_FIT_WANTED and conditioning(up) <= CONDITION_LIMIT:
            return RequestedPose(None, None, "the poses are enough")
        direction = next_direction(up)
        return RequestedPose(face_of(direction), direction, f"helps most: {direction_text(direction)}")

    def fit(self, poses: Poses) -> CalibrationFit:
        """See `fit_norm`."""
        return fit_norm(poses, self._nominal.units_per_g, self._frame_u_deg, self._parent)
