"""A procedure that collects resting poses for a plan and fits them at the end."""

from dataclasses import dataclass
from typing import Protocol

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.poses.pose import Array, Face, Pose, RawReadings
from gateway.calibration.poses.pose_finder import NominalSensitivity, PoseFinder

LARGEST_COUNT = 200
"""Poses of one session; memory and the fit stay bounded."""

Poses = tuple[Pose, ...]


@dataclass(frozen=True, slots=True)
class RequestedPose:
    """What is still to be done."""

    face: Face | None
    direction: Array | None
    """Where up should point next, a unit vector; None: nothing is missing."""
    text: str


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a procedure has come; what the rigger is shown."""

    poses: tuple[Pose, ...]
    wanted: int
    """Poses needed at least."""
    still: bool
    """The housing is at rest now."""
    pose_fraction: float
    """Of the readings of the pose that is being taken, 0 to 1."""
    seconds_left: float | None
    """Until that pose is taken; None while it moves."""
    next_face: Face | None
    """Which sensor axis should point up next; None: any, or complete."""
    next_direction: tuple[float, float, float] | None
    """Where up should point in the sensor's axes next, a unit vector; None: complete."""
    complete: bool
    text: str
    """One line for the rigger: what to do now, or what was wrong with the pose."""


class PosePlan(Protocol):
    """Which poses a method takes, and what it makes of them."""

    @property
    def method(self) -> str:
        """Its name in the record."""
        ...

    @property
    def wanted(self) -> int:
        """Poses needed at least."""
        ...

    def receive(self, pose: Pose, earlier: Poses) -> tuple[Pose | None, str]:
        """The pose as it is kept, None where it is refused, and what to tell the rigger."""
        ...

    def next(self, poses: Poses) -> RequestedPose:
        """What to do next."""
        ...

    def fit(self, poses: Poses) -> CalibrationFit:
        """Raises `NotDeterminedError`."""
        ...


class PoseProcedure:
    """`Procedure`: feed, progress, resume, finish."""

    def __init__(self, plan: PosePlan, nominal: NominalSensitivity) -> None:
        self._plan = plan
        self._finder = PoseFinder(nominal)
        self._poses: Poses = ()
        self._said = ""

    @property
    def method(self) -> str:
        """`six-position` or `norm-fit`."""
        return self._plan.method

    def feed(self, readings: RawReadings) -> None:
        """Take readings."""
        for pose in self._finder.feed(readings):
            self._take(pose)

    def cut(self) -> None:
        """The stretch of readings ends; what is fed next is another pose. A pose that is good enough by now is kept."""
        for pose in self._finder.cut():
            self._take(pose)

    def resume(self, poses: Poses) -> None:
        """Go on from poses that were taken before a restart."""
        self._poses = tuple(poses)
        if poses:
            self._finder.set_expected_pose(poses[-1].mean)

    def progress(self) -> Progress:
        """How far it has come."""
        wanted = self._plan.next(self._poses)
        heading = None
        if wanted.direction is not None:
            x, y, z = wanted.direction.tolist()
            heading = (x, y, z)
        return Progress(
            poses=self._poses,
            wanted=self._plan.wanted,
            still=self._finder.still,
            pose_fraction=self._finder.fraction,
            seconds_left=self._finder.seconds_left,
            next_face=wanted.face,
            next_direction=heading,
            complete=wanted.direction is None,
            text="; ".join(part for part in (self._finder.text, self._said, wanted.text) if part),
        )

    def finish(self) -> CalibrationFit:
        """The fit; a pose that is being taken counts if it is good enough. Raises `NotDeterminedError`."""
        self.cut()
        return self._plan.fit(self._poses)

    def _take(self, pose: Pose) -> None:
        if len(self._poses) >= LARGEST_COUNT:
            self._said = f"{LARGEST_COUNT} poses are enough; finish"
            return
        kept, self._said = self._plan.receive(pose, self._poses)
        if kept is not None:
            self._poses = (*self._poses, kept)
        quiet = tuple(one for one in self._poses if self._finder.was_still(one))
        if len(quiet) < len(self._poses):
            self._said += (
                f"; {len(self._poses) - len(quiet)} earlier pose was not still by the noise seen since: take it again"
            )
            self._poses = quiet
