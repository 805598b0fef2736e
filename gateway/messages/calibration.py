"""The messages of the calibration in force and of a recalibration."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from gateway.messages.header import CalibrationStatus, Message

SessionPhase = Literal["idle", "collecting", "review", "committed", "rejected"]
ACTIVE_PHASES: tuple[SessionPhase, ...] = ("collecting", "review")
CONFIRM = "confirm with plumbline remote cancel that the housing hangs on the rope again"
STAYS_SUSPENDED = f"; alerts stay suspended: {CONFIRM}"
"""End of the text of a session that has ended without a person's word."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionPose:
    """One pose that was taken."""

    face: Annotated[str | None, Field(description="sensor axis that pointed up; null: no axis near the vertical")] = (
        None
    )
    count: int
    used: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSession:
    """The state of a recalibration; faces and directions are in the sensor's axes."""

    id: Annotated[str, Field(description="id of the request that started the session; empty before the first session")]
    phase: SessionPhase
    method: str
    by: Annotated[str, Field(description="who sent the request, as stated in it")]
    poses: list[SessionPose]
    wanted: Annotated[int, Field(description="smallest number of poses needed")]
    still: Annotated[bool, Field(description="whether the housing is at rest")]
    pose_fraction: Annotated[float, Field(description="progress of the current pose, 0 to 1")]
    seconds_left: Annotated[
        float | None, Field(description="seconds until the current pose is complete; null while the housing moves")
    ] = None
    next_face: Annotated[
        str | None, Field(description="sensor axis that should point up next; null: see next_direction")
    ] = None
    next_direction: Annotated[
        list[float] | None,
        Field(description="direction in the sensor's axes that should point up next; null: complete"),
    ] = None
    record_id: Annotated[str | None, Field(description="id of the new record, from the review on")] = None
    reasons: Annotated[list[str], Field(description="why the record may not be committed, or only with a reason")]
    committable: Annotated[
        bool, Field(description="whether the record in review may be committed; `reasons` state if that needs a reason")
    ] = False
    suspended: Annotated[bool, Field(description="alerts are suspended, because no reading describes the load")]
    notes: Annotated[list[str], Field(description="change since the previous record, warnings of the fit")]
    text: Annotated[str, Field(description="one line: what to do now, or how the session ended")]
    hints: Annotated[
        list[str] | None,
        Field(description="what to do now, or what was wrong with the pose, as codes; null: not stated"),
    ] = None

    @property
    def suspension(self) -> str | None:
        """Why nothing is known of the load; None: it is known."""
        if not self.suspended:
            return None
        if self.phase in ACTIVE_PHASES:
            return f"SUSPENDED: the sensor is being recalibrated ({self.method}, by {self.by})"
        return f"SUSPENDED: the recalibration has ended ({self.text.removesuffix(STAYS_SUSPENDED)}); {CONFIRM}"


NO_SESSION = CalibrationSession(
    id="",
    phase="idle",
    method="",
    by="",
    poses=[],
    wanted=0,
    still=False,
    pose_fraction=0.0,
    seconds_left=None,
    next_face=None,
    next_direction=None,
    record_id=None,
    reasons=[],
    suspended=False,
    notes=[],
    text="",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration(Message):
    """The calibration in force."""

    status: CalibrationStatus
    device_id: str
    record: Annotated[dict[str, Any], Field(description="the calibration record; empty where there is none")]
    in_force: Annotated[
        dict[str, Any],
        Field(
            description="specific_force_g = gain_g_per_unit @ raw + bias_g, in the housing frame; where the record has a thermal "
            "model, raw is first brought to its reference temperature"
        ),
    ]
    text: str
    session: CalibrationSession = NO_SESSION


def created_utc(calibration: Calibration) -> datetime | None:
    """Return when the record in force was made; None where there is none, or it states no time."""
    try:
        created = datetime.fromisoformat(str(calibration.record.get("created_utc", "")))
    except ValueError:
        return None
    return created if created.tzinfo is not None else created.replace(tzinfo=UTC)
