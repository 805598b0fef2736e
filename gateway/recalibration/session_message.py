"""The session as the `calibration` message contains it. Faces and directions are in the sensor's axes, as in the record."""

from dataclasses import asdict

from pydantic import TypeAdapter

from gateway.calibration.pose_procedure import PoseProgress
from gateway.messages import NO_SESSION, CalibrationSession
from gateway.recalibration.session import CONFIRM, Session

MESSAGE_ADAPTER = TypeAdapter(CalibrationSession)
"""Takes the fields of the message and ignores all others."""


def make_session_message(session: Session | None, progress: PoseProgress | None) -> CalibrationSession:
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
        "suspended": session.suspension is not None,
        "notes": [] if session.judgement is None else session.judgement.notes,
        "text": _text(session, progress),
    }
    return MESSAGE_ADAPTER.validate_python(content)


def _reasons(session: Session) -> list[str]:
    if session.phase != "review" or session.judgement is None:
        return []
    acceptance = session.judgement
    return [*acceptance.refused, *(f"{text}; give a reason" for text in acceptance.implausible)]


def _text(session: Session, progress: PoseProgress | None) -> str:
    if session.phase == "collecting":
        return "" if progress is None else progress.text
    if session.phase == "review":
        if session.is_committable:
            return "all poses are taken: the record may be committed"
        return "the record may not be committed"
    return f"{session.text}; alerts stay suspended: {CONFIRM}" if session.left else session.text
