"""The session: `idle -> collecting -> review -> committed | rejected`. Values and transitions; the time is an argument."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.poses.pose import Pose

Phase = Literal["idle", "collecting", "review", "committed", "rejected"]
ACTIVE: tuple[Phase, ...] = ("collecting", "review")
CONFIRM = "plumbline remote cancel says that the housing hangs on the rope again"
IDLE_S = 300.0
"""A collecting session in which no pose is taken for this long has been left."""
REVIEW_S = 1800.0
WHOLE_S = 3600.0
MOST_RESTARTS = 10
"""Without a pose in between: what makes the gateway end, and it may be the session, must not do so for ever."""
CLOCK_SLACK_S = 60.0
"""A clock that is set back by more while the gateway was away no longer tells how long that was."""


class Session(BaseModel):
    """One session as it stands, and as the journal has it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    """Of the request that began it."""
    phase: Phase
    method: str
    by: str
    device_id: str
    parent: str | None
    """Record in force when it began."""
    begun_ns: int
    """Gateway time."""
    touched_ns: int
    """Of the last transition or pose."""
    poses: tuple[Pose, ...] = ()
    restarts: int = 0
    """Of the gateway, since the last pose or transition."""
    candidate: dict[str, Any] | None = None
    """The new record, from review on."""
    judgement: Acceptance | None = None
    text: str = ""
    """How it ended."""
    left: bool = False
    """It ended by itself, and nobody has said since that the housing hangs on the rope again."""

    @property
    def active(self) -> bool:
        """It has not ended."""
        return self.phase in ACTIVE

    @property
    def record_id(self) -> str | None:
        """Of the new record."""
        return None if self.candidate is None else str(self.candidate["id"])

    def with_poses(self, poses: tuple[Pose, ...], now_ns: int) -> "Session":
        """Poses have been taken."""
        return self.model_copy(update={"poses": poses, "touched_ns": now_ns, "restarts": 0})

    def reviewed(self, candidate: dict[str, Any], judgement: Acceptance, now_ns: int) -> "Session":
        """All poses are there and the fit is made."""
        return self.model_copy(
            update={
                "phase": "review",
                "candidate": candidate,
                "judgement": judgement,
                "touched_ns": now_ns,
                "restarts": 0,
            }
        )

    def ended(self, phase: Literal["committed", "rejected"], text: str, now_ns: int, *, left: bool) -> "Session":
        """It is over; `left`: by itself, with the housing wherever it is."""
        return self.model_copy(update={"phase": phase, "text": text, "touched_ns": now_ns, "left": left})

    @property
    def suspends(self) -> str | None:
        """Why nothing may be said of the load; None: it may."""
        if self.active:
            return f"SUSPENDED: the sensor is being recalibrated ({self.method}, by {self.by})"
        if self.left:
            return f"SUSPENDED: the recalibration has ended ({self.text}); {CONFIRM}"
        return None

    def timed_out(self, now_ns: int) -> str | None:
        """Why it has lasted too long; None: it has not."""
        if not self.active:
            return None
        if now_ns - self.begun_ns > WHOLE_S * 1e9:
            return f"lasted longer than {WHOLE_S / 60:.0f} minutes"
        waited_s = (now_ns - self.touched_ns) / 1e9
        if self.phase == "collecting" and waited_s > IDLE_S:
            return f"no pose was taken for {IDLE_S / 60:.0f} minutes"
        if self.phase == "review" and waited_s > REVIEW_S:
            return f"not committed within {REVIEW_S / 60:.0f} minutes"
        return None

    def lost_by_restart(self, now_ns: int) -> str | None:
        """Why it cannot go on after a restart; None: it can."""
        if now_ns < self.touched_ns - CLOCK_SLACK_S * 1e9:
            return "the clock went back while the gateway was away: how long that was is not known"
        if self.restarts >= MOST_RESTARTS:
            return f"the gateway was started {self.restarts} times without a pose in between"
        return self.timed_out(now_ns)

    def resumed(self) -> "Session":
        """It goes on after a restart."""
        return self.model_copy(update={"restarts": self.restarts + 1})
