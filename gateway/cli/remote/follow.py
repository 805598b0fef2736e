"""Display of a recalibration session until its review or its end: a bar in a terminal, a line per change elsewhere."""

import time
from typing import Any, TextIO

from gateway.bus.client import GatewayClient
from gateway.calibration.record import PoseMethod
from gateway.cli.terminal.output import StatusLine
from gateway.daemon.runtime.worker import BoundedQueue

MAX_STALE_ANSWERS = 4
"""A gateway that has just accepted a session may still report the time before, at most this often. Basis: two seconds of
sessions."""
SESSION_SILENCE_S = 1.5
"""A gateway that collects poses reports its session twice per second; after this silence it is queried. Basis: three messages of
the session."""
MAX_QUEUED_MESSAGES = 256
"""Messages that may wait. Basis: a choice; minutes of a session, and a bound of the memory."""
HOLD_BAR_CHARACTERS = 24
"""Width of the bar, characters. Basis: a choice; a third of a line."""
NO_ANSWER = "no answer from the gateway; waiting for it"
CONTINUES = "the session continues: plumbline remote recalibrate --follow shows it, plumbline remote cancel ends it"


def watch_session(client: GatewayClient, session_id: str | None, out: TextIO) -> int:
    """Show a session until it is in review or has ended; return 0 if its record may be or has been committed, else 1."""
    display = SessionDisplay(out)
    messages = _subscribe(client)
    session = _query(client)
    stale = 0 if session_id is None else MAX_STALE_ANSWERS
    try:
        while True:
            if session is not None:
                session_id = session_id or session["id"]
                if session["id"] == session_id and session["phase"] != "idle":
                    stale = 0
                    display.show(session)
                    if session["phase"] != "collecting":
                        return _show_result(session, display)
                elif stale == 0:
                    display.add_line("no such session is under way")
                    return 1
                else:
                    stale -= 1
            session = _wait_for_session(client, messages, display)
    except KeyboardInterrupt:
        display.add_line(CONTINUES)
        raise


def _subscribe(client: GatewayClient) -> BoundedQueue[dict[str, Any]]:
    messages: BoundedQueue[dict[str, Any]] = BoundedQueue(MAX_QUEUED_MESSAGES)
    client.subscribe("calibration", messages.put)
    return messages


def _wait_for_session(
    client: GatewayClient, messages: BoundedQueue[dict[str, Any]], display: "SessionDisplay"
) -> dict[str, Any] | None:
    """Return the next state of the session; None if nobody answers, after an attempt to reconnect."""
    message = messages.get(SESSION_SILENCE_S)
    if message is not None:
        return _session(message)
    session = _query(client)
    if session is None:
        display.show_waiting()
        if client.reconnect():
            client.subscribe("calibration", messages.put)
        else:
            time.sleep(SESSION_SILENCE_S)
    return session


def _query(client: GatewayClient) -> dict[str, Any] | None:
    status = client.status()
    return None if status is None or "calibration" not in status else _session(status["calibration"])


def _session(message: dict[str, Any]) -> dict[str, Any]:
    session: dict[str, Any] = message["session"]
    return session


def _show_result(session: dict[str, Any], display: "SessionDisplay") -> int:
    if session["phase"] == "review":
        for reason in [*session["notes"], *session["reasons"]]:
            display.add_line(f"  {reason}")
        display.add_line(
            f"record {session['record_id']} is in review: plumbline remote commit, or plumbline remote cancel"
        )
        return 0 if session.get("committable", False) else 1
    return 0 if session["phase"] == "committed" else 1


class SessionDisplay:
    """Shows a bar in a terminal, and elsewhere a line for each change of the text."""

    def __init__(self, out: TextIO) -> None:
        self._line = StatusLine(out)

    def show(self, session: dict[str, Any]) -> None:
        """Show the state of the session."""
        taken, wanted = _count_poses(session), max(session["wanted"], 1)
        if session["phase"] != "collecting":
            self.add_line(f"{session['phase']}: {session['text']}")
            return
        text = f"{taken} of {wanted} poses; {session['text']}"
        if self._line.is_terminal:
            fraction = min((taken + session["pose_fraction"]) / wanted, 1.0)
            bar = ("#" * round(fraction * HOLD_BAR_CHARACTERS)).ljust(HOLD_BAR_CHARACTERS, "-")
            progress = f"{taken}/{wanted} [{bar}] {_stillness(session):14} {_next_face(session)}{session['text']}"
            self._line.update(progress, text)
        else:
            self._line.update(text, text)

    def show_waiting(self) -> None:
        """Show that the gateway does not answer."""
        self._line.update(NO_ANSWER, NO_ANSWER)

    def add_line(self, text: str) -> None:
        """Write a line that is not overwritten."""
        self._line.commit(text)


def _count_poses(session: dict[str, Any]) -> int:
    """Return the number of different poses: of the six faces, or of all attitudes."""
    used = [pose for pose in session["poses"] if pose["used"]]
    return len({pose["face"] for pose in used}) if session["method"] == PoseMethod.SIX_POSITION else len(used)


def _next_face(session: dict[str, Any]) -> str:
    """Return the next face, which stands before the text because a narrow terminal truncates that."""
    return f"next {session['next_face']} up; " if session["next_face"] else ""


def _stillness(session: dict[str, Any]) -> str:
    if not session["still"]:
        return "moving"
    left_s = session["seconds_left"]
    return "still" if left_s is None else f"still {left_s:.0f} s left"
