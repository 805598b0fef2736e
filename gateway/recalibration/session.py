"""The recalibration session: `idle -> collecting -> review -> committed | rejected`. Values and transitions.

In the `calibration` message, faces and directions are in the sensor's axes, as in the record.
"""

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, TypeAdapter

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.pose import Pose
from gateway.messages import NO_SESSION, CalibrationSession, SessionPhase
from gateway.messages.calibration import ACTIVE_PHASES, STAYS_SUSPENDED

if TYPE_CHECKING:
    from gateway.calibration.pose_procedure import PoseProgress

MAX_IDLE_S = 300.0
"""Longest time without a pose, s; then the session counts as abandoned. Basis: a choice; a housing is turned in seconds, and a
person who left has forgotten the session."""
MAX_REVIEW_S = 1800.0
"""Longest review, s. Basis: a choice; a person reads a report in minutes and may ask another."""
MAX_SESSION_S = 3600.0
"""Longest session, s. Basis: a choice; 200 poses of some 15 s."""
MAX_RESTARTS = 10
"""Largest number of restarts without a pose in between: a session that may itself end the gateway does not continue for ever.
Basis: a choice; power fails now and then, and a defect ends the gateway at each start."""
MAX_CLOCK_STEP_S = 60.0
"""Largest step back of the clock, s, at which the duration of a stop is still known. Basis: a choice; a clock without battery is
older by hours, and corrections are smaller."""
MESSAGE_ADAPTER = TypeAdapter(CalibrationSession)
"""Takes the fields of the message and ignores all others."""


@dataclass(frozen=True, slots=True)
class Timestamp:
    """One instant, by the gateway's time and by the wall clock."""

    time_ns: int
    """Gateway time, which never steps within a run."""
    utc_ns: int
    """Time of the wall clock."""

    @property
    def utc(self) -> str:
        """UTC to the millisecond, for people and records."""
        at = datetime.fromtimestamp(self.utc_ns / 1e9, UTC)
        return at.isoformat(timespec="milliseconds").replace("+00:00", "Z")


class Session(BaseModel):
    """One session, as the journal stores it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    """Id of the request that started the session."""
    phase: SessionPhase
    method: str
    by: str
    device_id: str
    parent: str | None
    """Id of the record in force at the start."""
    begun_ns: int
    """Gateway time of the start."""
    touched_ns: int
    """Gateway time of the last transition or pose."""
    poses: tuple[Pose, ...] = ()
    restarts: int = 0
    """Number of restarts of the gateway since the last pose or transition."""
    candidate: dict[str, Any] | None = None
    """The new record, from the review on."""
    judgement: Acceptance | None = None
    text: str = ""
    """Outcome of an ended session."""
    left: bool = False
    """Whether it ended by itself, and no person has confirmed since that the housing hangs on the rope again."""

    @property
    def is_active(self) -> bool:
        """Whether the session has not ended."""
        return self.phase in ACTIVE_PHASES

    @property
    def is_committable(self) -> bool:
        """Whether the record in review meets the limits; it may still require a reason."""
        return self.phase == "review" and self.judgement is not None and not self.judgement.refused

    @property
    def record_id(self) -> str | None:
        """Id of the new record."""
        return None if self.candidate is None else str(self.candidate["id"])

    @property
    def is_suspended(self) -> bool:
        """Whether nothing is known of the load, so that alerts are suspended."""
        return self.is_active or self.left

    def with_poses(self, poses: tuple[Pose, ...], now_ns: int) -> "Session":
        """Return the session with these poses."""
        return self.model_copy(update={"poses": poses, "touched_ns": now_ns, "restarts": 0})

    def start_review(self, candidate: dict[str, Any], acceptance: Acceptance, now_ns: int) -> "Session":
        """Return the session in review of its new record."""
        return self.model_copy(
            update={
                "phase": "review",
                "candidate": candidate,
                "judgement": acceptance,
                "touched_ns": now_ns,
                "restarts": 0,
            }
        )

    def end(self, phase: Literal["committed", "rejected"], text: str, now_ns: int, *, left: bool) -> "Session":
        """Return the ended session; `left` if it ended by itself, so that the place of the housing is not known."""
        return self.model_copy(update={"phase": phase, "text": text, "touched_ns": now_ns, "left": left})

    def resume(self) -> "Session":
        """Return the session after a restart of the gateway."""
        return self.model_copy(update={"restarts": self.restarts + 1})

    def timeout_reason(self, now_ns: int) -> str | None:
        """Return why the session has lasted too long, or None."""
        if not self.is_active:
            return None
        if now_ns - self.begun_ns > MAX_SESSION_S * 1e9:
            return f"lasted longer than {MAX_SESSION_S / 60:.0f} minutes"
        waited_s = (now_ns - self.touched_ns) / 1e9
        if self.phase == "collecting" and waited_s > MAX_IDLE_S:
            return f"no pose was taken for {MAX_IDLE_S / 60:.0f} minutes"
        if self.phase == "review" and waited_s > MAX_REVIEW_S:
            return f"not committed within {MAX_REVIEW_S / 60:.0f} minutes"
        return None

    def restart_refusal(self, now_ns: int) -> str | None:
        """Return why the session cannot continue after a restart, or None."""
        if now_ns < self.touched_ns - MAX_CLOCK_STEP_S * 1e9:
            return "the clock was set back while the gateway was stopped, so the duration of the stop is not known"
        if self.restarts >= MAX_RESTARTS:
            return f"the gateway was started {self.restarts} times without a pose in between"
        return self.timeout_reason(now_ns)


def abandoned_session(device_id: str, text: str, now: Timestamp) -> Session:
    """Return an abandoned session, for a journal that cannot show whether one was active."""
    return Session(
        id="unknown",
        phase="rejected",
        method="",
        by="",
        device_id=device_id,
        parent=None,
        begun_ns=now.time_ns,
        touched_ns=now.time_ns,
        text=text,
        left=True,
    )


def make_session_message(session: Session | None, progress: "PoseProgress | None") -> CalibrationSession:
    """Return the message of a session, with the progress of its procedure while it collects poses."""
    if session is None:
        return NO_SESSION
    content = asdict(NO_SESSION) | {"wanted": len(session.poses)} | session.model_dump()
    if progress is not None:
        content |= asdict(progress)
    content |= {
        "record_id": session.record_id,
        "reasons": _reasons(session),
        "committable": session.is_committable,
        "suspended": session.is_suspended,
        "notes": [] if session.judgement is None else session.judgement.notes,
        "text": _text(session, progress),
    }
    return MESSAGE_ADAPTER.validate_python(content)


def _reasons(session: Session) -> list[str]:
    if session.phase != "review" or session.judgement is None:
        return []
    acceptance = session.judgement
    return [*acceptance.refused, *(f"{text}; give a reason" for text in acceptance.implausible)]


def _text(session: Session, progress: "PoseProgress | None") -> str:
    if session.phase == "collecting":
        return "" if progress is None else progress.text
    if session.phase == "review":
        if session.is_committable:
            return "all poses are taken: the record may be committed"
        return "the record may not be committed"
    return f"{session.text}{STAYS_SUSPENDED}" if session.left else session.text


def committed_text(record_id: str | None) -> str:
    """Return the outcome of a session whose record was put in force."""
    return f"record {record_id} was put in force"


def withdrawn_text(record_id: str | None, by: str, reason: str) -> str:
    """Return the outcome of such a session after a rollback."""
    return f"{committed_text(record_id)}, and withdrawn by {by}" + (f": {reason}" if reason else "")
