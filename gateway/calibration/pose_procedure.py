"""The pose procedure: it collects resting poses for the plan of a method, and fits them at the end.

A plan requires six faces in any order, or directions all round.
"""

from dataclasses import dataclass, replace

import numpy as np

from gateway.calibration.calibration_fit import MAX_CONDITION_NUMBER, CalibrationFit
from gateway.calibration.methods.experiment_design import condition_number, next_direction
from gateway.calibration.methods.norm_fit import FRAME_U_DEG, N_PARAMETERS, fit_norm
from gateway.calibration.methods.six_position import fit_six_positions, missing_faces
from gateway.calibration.pose import (
    FACE_DIRECTIONS,
    FACES,
    PLACEMENT_U_DEG,
    Face,
    NominalSensitivity,
    Pose,
    RawReadings,
    angle_to_face_deg,
    describe_direction,
    find_face,
    without_tilted_poses,
)
from gateway.calibration.pose_finder import PoseFinder
from gateway.calibration.record import CalibrationError, CalibrationRecord, PoseMethod
from gateway.messages.header import Reason, ReasonCode
from gateway.numerics.array import Array

MAX_POSES = 200
"""Largest number of poses of one session. Basis: a choice; ten times a usual session, and a bound of memory and of the time of
the fit."""

Poses = tuple[Pose, ...]
MIN_DIFFERENCE_G = 0.25
"""Least difference between the readings of two poses of a norm fit, g. Basis: a choice; 15 degrees, which a hand makes without a
tool; closer poses tell the fit little new."""
NORM_FIT_POSES = N_PARAMETERS + 3
"""Number of poses that the norm fit asks for. Basis: three more than unknowns, so that the fit is checked."""


@dataclass(frozen=True, slots=True)
class RequestedPose:
    """The pose that a plan requests next."""

    face: Face | None
    """Face to point up; None: any attitude, or the plan is complete."""
    direction: Array | None
    """Direction to point up, a unit vector; None: the plan is complete."""
    text: str


@dataclass(frozen=True, slots=True)
class PoseProgress:
    """Progress of a procedure, for display to the rigger."""

    poses: Poses
    wanted: int
    """Least number of poses."""
    still: bool
    """Whether the housing is at rest now."""
    pose_fraction: float
    """Completed fraction of the pose that is being taken, 0 to 1."""
    seconds_left: float | None
    """Expected time until that pose is complete, s; None while the housing moves."""
    next_face: Face | None
    """Sensor axis that should point up next; None: any attitude, or complete."""
    next_direction: tuple[float, float, float] | None
    """Direction in the sensor's axes that should point up next, a unit vector; None: complete."""
    complete: bool
    """Whether all requested poses are taken."""
    text: str
    """One line for the rigger: what to do next, or what was wrong with the pose."""
    hints: tuple[str, ...]
    """The same as codes; the next face or direction is no part of them."""


class PoseProcedure:
    """Collects poses from readings. What the rigger does never raises an error; the progress states it."""

    def __init__(self, plan: "SixPositionPlan | NormFitPlan", nominal: NominalSensitivity) -> None:
        self._plan = plan
        self._finder = PoseFinder(nominal)
        self._poses: Poses = ()
        self._pose_hints: tuple[Reason, ...] = ()

    def feed(self, readings: RawReadings) -> None:
        """Process readings."""
        for pose in self._finder.feed(readings):
            self._add_pose(pose)

    def end_segment(self) -> None:
        """End a segment of readings: later readings belong to another pose. An incomplete pose is kept if it is good enough."""
        for pose in self._finder.end_segment():
            self._add_pose(pose)

    def resume(self, poses: Poses) -> None:
        """Continue from poses that were taken before a restart."""
        self._poses = tuple(poses)
        if poses:
            self._finder.set_last_pose(poses[-1].mean)

    @property
    def rests(self) -> int:
        """Number of rests in the readings so far that lasted long enough for a pose."""
        return self._finder.rests

    def progress(self) -> PoseProgress:
        """Return the progress."""
        requested = self._plan.request_next(self._poses)
        direction = None
        if requested.direction is not None:
            x, y, z = requested.direction.tolist()
            direction = (x, y, z)
        return PoseProgress(
            poses=self._poses,
            wanted=self._plan.n_poses,
            still=self._finder.still,
            pose_fraction=self._finder.fraction,
            seconds_left=self._finder.seconds_left,
            next_face=requested.face,
            next_direction=direction,
            complete=requested.direction is None,
            text="; ".join((self._finder.text, *self._pose_hints, requested.text)),
            hints=tuple(hint.code for hint in (self._finder.text, *self._pose_hints)),
        )

    def finish(self) -> CalibrationFit:
        """Return the fit, with the pose that is being taken if it is good enough. Raises `NotDeterminedError`."""
        self.end_segment()
        return self._plan.fit(self._poses)

    def _add_pose(self, pose: Pose) -> None:
        if len(self._poses) >= MAX_POSES:
            self._pose_hints = (Reason("pose_enough", f"{MAX_POSES} poses are enough; finish"),)
            return
        accepted, hint = self._plan.accept(pose, self._poses)
        self._pose_hints = (hint,)
        self._poses = (*self._poses, accepted)
        still = tuple(one for one in self._poses if self._finder.was_still(one))
        if len(still) < len(self._poses):
            words = f"{len(self._poses) - len(still)} earlier pose was not still by the noise seen since: take it again"
            self._pose_hints = (hint, Reason("pose_not_still", words))
            self._poses = still


class SixPositionPlan:
    """Every face up at least once; repeats of a face are averaged. The plan of a method requests poses, and fits them."""

    n_poses = len(FACES)

    def __init__(self, placement_u_deg: float) -> None:
        self._placement_u_deg = placement_u_deg

    def accept(self, pose: Pose, earlier: Poses) -> tuple[Pose, Reason]:
        """Return the pose as it is stored, one on no face marked as not used, and a text for the rigger."""
        if pose.face is None:
            off_deg = angle_to_face_deg(np.array(pose.mean))
            words = f"{off_deg:.0f} deg off the nearest face: not used; lay it on a face"
            return replace(pose, used=False), Reason("pose_off_face", words)
        count = 1 + sum(one.face == pose.face for one in earlier)
        again = f" again: {count} are averaged" if count > 1 else ""
        return pose, Reason("pose_taken", f"{pose.face} taken{again}")

    def request_next(self, poses: Poses) -> RequestedPose:
        """Request the first missing face; a pose that the others show to be tilted counts for none."""
        missing = missing_faces(without_tilted_poses(poses))
        if not missing:
            return RequestedPose(None, None, "all six faces are taken")
        return RequestedPose(
            missing[0], FACE_DIRECTIONS[missing[0]], f"next: {missing[0]} up; missing: {', '.join(missing)}"
        )

    def fit(self, poses: Poses) -> CalibrationFit:
        """Return the fit of `fit_six_positions`."""
        return fit_six_positions(poses, self._placement_u_deg)


class NormFitPlan:
    """Poses in all directions. A pose near an earlier one counts, but not as one of those that the fit asks for."""

    n_poses = NORM_FIT_POSES

    def __init__(self, nominal: NominalSensitivity, frame_u_deg: float, parent: CalibrationRecord | None) -> None:
        self._nominal = nominal
        self._frame_u_deg = frame_u_deg
        self._parent = parent

    def accept(self, pose: Pose, earlier: Poses) -> tuple[Pose, Reason]:
        """Return the pose, and a text for the rigger, which tells one within 15 degrees of an earlier one."""
        near = next((number for number, one in enumerate(earlier, start=1) if self._is_near(pose, one)), None)
        hint = "" if near is None else f", near pose {near}: it adds little; turn it further"
        code: ReasonCode = "pose_taken" if near is None else "pose_near_another"
        return pose, Reason(code, f"pose {len(earlier) + 1} taken{hint}")

    def _is_near(self, pose: Pose, other: Pose) -> bool:
        """Return whether two poses are within 15 degrees; zero-g offsets cancel in the difference of two readings."""
        return bool(np.linalg.norm(np.subtract(pose.mean, other.mean)) < MIN_DIFFERENCE_G * self._nominal.units_per_g)

    def request_next(self, poses: Poses) -> RequestedPose:
        """Request the direction that determines the parameters best."""
        apart = [pose for place, pose in enumerate(poses) if not any(self._is_near(pose, one) for one in poses[:place])]
        readings = np.array([self._nominal.in_g(pose.mean) for pose in apart]).reshape(-1, 3)
        up = readings / np.linalg.norm(readings, axis=1, keepdims=True)
        if len(up) >= NORM_FIT_POSES and condition_number(up) <= MAX_CONDITION_NUMBER:
            return RequestedPose(None, None, "the poses are enough")
        direction = next_direction(up)
        return RequestedPose(find_face(direction), direction, f"helps most: {describe_direction(direction)}")

    def fit(self, poses: Poses) -> CalibrationFit:
        """Return the fit of `fit_norm`."""
        return fit_norm(poses, self._nominal.units_per_g, self._frame_u_deg, self._parent)


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
