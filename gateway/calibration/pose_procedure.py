"""The pose procedure: it collects resting poses for a plan and fits them at the end."""

from dataclasses import dataclass
from typing import Protocol

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.poses.pose import Face, NominalSensitivity, Pose, RawReadings
from gateway.calibration.poses.pose_finder import PoseFinder
from gateway.numerics.array import Array

MAX_POSES = 200
"""Largest number of poses of one session, which bounds memory and the time of the fit. Basis: a choice; ten times a usual
session, and a bound of memory and of the time of the fit."""

Poses = tuple[Pose, ...]


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


class PosePlan(Protocol):
    """The poses that a method requires, and their fit."""

    @property
    def n_poses(self) -> int:
        """Least number of poses."""
        ...

    def accept(self, pose: Pose, earlier: Poses) -> tuple[Pose | None, str]:
        """Return the pose as it is stored, None if it is refused, and a text for the rigger."""
        ...

    def request_next(self, poses: Poses) -> RequestedPose:
        """Return the pose to take next."""
        ...

    def fit(self, poses: Poses) -> CalibrationFit:
        """Return the fit. Raises `NotDeterminedError`."""
        ...


class PoseProcedure:
    """Collects poses from readings. What the rigger does never raises an error; the progress states it."""

    def __init__(self, plan: PosePlan, nominal: NominalSensitivity) -> None:
        self._plan = plan
        self._finder = PoseFinder(nominal)
        self._poses: Poses = ()
        self._pose_text = ""

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
            text="; ".join(part for part in (self._finder.text, self._pose_text, requested.text) if part),
        )

    def finish(self) -> CalibrationFit:
        """Return the fit, with the pose that is being taken if it is good enough. Raises `NotDeterminedError`."""
        self.end_segment()
        return self._plan.fit(self._poses)

    def _add_pose(self, pose: Pose) -> None:
        if len(self._poses) >= MAX_POSES:
            self._pose_text = f"{MAX_POSES} poses are enough; finish"
            return
        accepted, self._pose_text = self._plan.accept(pose, self._poses)
        if accepted is not None:
            self._poses = (*self._poses, accepted)
        still = tuple(one for one in self._poses if self._finder.was_still(one))
        if len(still) < len(self._poses):
            self._pose_text += (
                f"; {len(self._poses) - len(still)} earlier pose was not still by the noise seen since: take it again"
            )
            self._poses = still
