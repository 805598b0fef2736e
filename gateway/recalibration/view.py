"""The session as others are shown it. Faces and directions are the sensor's own axes, as in the record."""

from gateway.calibration.procedures.pose_procedure import PoseProgress
from gateway.messages import NO_SESSION, CalibrationSession, SessionPose
from gateway.recalibration.session import CONFIRM, Session


def session_message(session: Session | None, progress: PoseProgress | None) -> CalibrationSession:
    """What is published of a session; `progress` of its procedure while it collects."""
    if session is None:
        return NO_SESSION
    direction = None if progress is None else progress.next_direction
    return CalibrationSession(
        id=session.id,
        phase=session.phase,
        method=session.method,
        by=session.by,
        poses=[SessionPose(face=pose.face, count=pose.count, used=pose.used) for pose in session.poses],
        wanted=len(session.poses) if progress is None else progress.wanted,
        still=progress is not None and progress.still,
        pose_fraction=0.0 if progress is None else progress.pose_fraction,
        seconds_left=None if progress is None else progress.seconds_left,
        next_face=None if progress is None else progress.next_face,
        next_direction=None if direction is None else list(direction),
        record_id=session.record_id,
        reasons=_reasons(session),
        committable=_is_committable(session),
        suspended=session.suspends is not None,
        notes=list(session.judgement.notes) if session.judgement is not None else [],
        text=_text(session, progress),
    )


def _reasons(session: Session) -> list[str]:
    if session.phase != "review" or session.judgement is None:
        return []
    judged = session.judgement
    return [*judged.refused, *(f"{text}; give a reason" for text in judged.implausible)]


def _is_committable(session: Session) -> bool:
    return session.phase == "review" and session.judgement is not None and not session.judgement.refused


def _text(session: Session, progress: PoseProgress | None) -> str:
    if session.phase == "collecting":
        return "" if progress is None else progress.text
    if session.phase == "review":
        if _is_committable(session):
            return "all poses are taken: the record may be committed"
        return "the record may not be committed"
    return f"{session.text}; alerts stay suspended: {CONFIRM}" if session.left else session.text
