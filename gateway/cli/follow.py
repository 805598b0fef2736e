"""A session, followed to its review or its end: a bar in a terminal, a line for each change elsewhere."""

import json
import time
from typing import Any, TextIO

import zenoh

from gateway.bus.client import GatewayClient
from gateway.calibration.pose_method import PoseMethod
from gateway.cli.status_line import StatusLine
from gateway.daemon.bounded_queue import BoundedQueue

STALE_ANSWERS = 4
"""A gateway that has just accepted a session may still tell of the time before, so often at most."""
LOOK_S = 1.5
"""While it collects a gateway tells of a session twice a second; after this silence it is asked."""
WAITING = 256
BAR = 24
NO_ANSWER = "no answer from the gateway; waiting for it"
GOES_ON = "the session goes on: plumbline remote recalibrate --follow shows it, plumbline remote cancel ends it"


def watch_session(client: GatewayClient, session_id: str | None, out: TextIO) -> int:
    """Show a session until it is reviewed or has ended; 0 where its record may be committed, or has been."""
    screen = Screen(out)
    news = _listen(client)
    session = _asked(client)
    stale = 0 if session_id is None else STALE_ANSWERS
    try:
        while True:
            if session is not None:
                session_id = session_id or session["id"]
                if session["id"] == session_id and session["phase"] != "idle":
                    stale = 0
                    screen.show(session)
                    if session["phase"] != "collecting":
                        return _result(session, screen)
                elif stale == 0:
                    screen.line("no such session is under way")
                    return 1
                else:
                    stale -= 1
            session = _next(client, news, screen)
    except KeyboardInterrupt:
        screen.line(GOES_ON)
        raise


def _listen(client: GatewayClient) -> BoundedQueue[zenoh.Sample]:
    news: BoundedQueue[zenoh.Sample] = BoundedQueue(WAITING)
    client.subscribe("calibration", news.put)
    return news


def _next(client: GatewayClient, news: BoundedQueue[zenoh.Sample], screen: "Screen") -> dict[str, Any] | None:
    """The session as it stands next; None while nobody answers, and the link is opened again."""
    sample = news.get(LOOK_S)
    if sample is not None:
        return _session(json.loads(sample.payload.to_bytes()))
    session = _asked(client)
    if session is None:
        screen.show_waiting()
        if client.reconnect():
            client.subscribe("calibration", news.put)
        else:
            time.sleep(LOOK_S)
    return session


def _asked(client: GatewayClient) -> dict[str, Any] | None:
    status = client.status()
    return None if status is None or "calibration" not in status else _session(status["calibration"])


def _session(message: dict[str, Any]) -> dict[str, Any]:
    session: dict[str, Any] = message["session"]
    return session


def _result(session: dict[str, Any], screen: "Screen") -> int:
    if session["phase"] == "review":
        for reason in [*session["notes"], *session["reasons"]]:
            screen.line(f"  {reason}")
        screen.line(f"record {session['record_id']} is in review: plumbline remote commit, or plumbline remote cancel")
        return 0 if session.get("committable", False) else 1
    return 0 if session["phase"] == "committed" else 1


class Screen:
    """A bar in a terminal; elsewhere a line each time that the words change."""

    def __init__(self, out: TextIO) -> None:
        self._line = StatusLine(out)

    def show(self, session: dict[str, Any]) -> None:
        """How the session stands."""
        taken, wanted = _poses_line(session), max(session["wanted"], 1)
        if session["phase"] != "collecting":
            self.line(f"{session['phase']}: {session['text']}")
            return
        said = f"{taken} of {wanted} poses; {session['text']}"
        if self._line.is_terminal:
            done = min((taken + session["pose_fraction"]) / wanted, 1.0)
            bar = ("#" * round(done * BAR)).ljust(BAR, "-")
            self._line.update(
                f"{taken}/{wanted} [{bar}] {_stillness(session):14} {_next_face(session)}{session['text']}", said
            )
        else:
            self._line.update(said, said)

    def show_waiting(self) -> None:
        """Nobody answers."""
        self._line.update(NO_ANSWER, NO_ANSWER)

    def line(self, text: str) -> None:
        """A line that stays."""
        self._line.commit(text)


def _poses_line(session: dict[str, Any]) -> int:
    """Poses that count: a face that lay up twice is one of six."""
    used = [pose for pose in session["poses"] if pose["used"]]
    return len({pose["face"] for pose in used}) if session["method"] == PoseMethod.SIX_POSITION else len(used)


def _next_face(session: dict[str, Any]) -> str:
    """Before the text, which a narrow terminal cuts off."""
    return f"next {session['next_face']} up; " if session["next_face"] else ""


def _stillness(session: dict[str, Any]) -> str:
    if not session["still"]:
        return "moving"
    left_s = session["seconds_left"]
    return "still" if left_s is None else f"still {left_s:.0f} s left"
