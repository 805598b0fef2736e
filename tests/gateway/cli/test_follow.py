"""Following a session: what is shown, when it ends, and what the exit code says."""

import io
import os
import pty
import struct
import termios
from collections.abc import Callable
from fcntl import ioctl
from typing import Any

import pytest

from gateway.bus.client import GatewayClient
from gateway.cli.remote import remote_session as following
from gateway.cli.remote.remote_session import watch_session
from tests.gateway.cli.terminal import TerminalText

COLLECTING: dict[str, Any] = {
    "id": "session-1",
    "phase": "collecting",
    "method": "six-position",
    "by": "ann",
    "poses": [{"face": "+x", "used": True}],
    "wanted": 6,
    "still": True,
    "pose_fraction": 0.5,
    "seconds_left": 2.4,
    "record_id": None,
    "reasons": [],
    "notes": [],
    "next_face": "-y",
    "text": "hold still",
}
POSE = COLLECTING["poses"][0]
REVIEW = COLLECTING | {
    "phase": "review",
    "record_id": "r2",
    "text": "all poses are taken: the record may be committed",
    "committable": True,
    "notes": ["since r1: offset +0.1 mg"],
}


class ScriptedLink(GatewayClient):
    """A gateway that says one thing after another: a session, or None while it is away."""

    def __init__(self, *said: Any) -> None:
        self._said = list(said)
        self.reconnects = 0

    def subscribe(self, topic: str, take: Callable[[Any], object]) -> None:
        self._take = take

    def status(self) -> dict[str, Any] | None:
        session = self._said.pop(0)
        while session is not None and self._said and self._said[0] is not None:
            self._take({"session": self._said.pop(0)})
        return None if session is None else {"calibration": {"session": session}}

    def reconnect(self) -> bool:
        self.reconnects += 1
        return self.reconnects > 1


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "SESSION_SILENCE_S", 0.01)


@pytest.mark.parametrize(
    ("last", "code", "said"),
    [
        (REVIEW, 0, "record r2 is in review: plumbline remote commit"),
        (
            REVIEW | {"committable": False, "text": "refused", "reasons": ["residual too large"]},
            1,
            "residual too large",
        ),
        (COLLECTING | {"phase": "rejected", "text": "cancelled by bob"}, 1, "rejected: cancelled by bob"),
        (COLLECTING | {"phase": "committed", "text": "record r2 is in force"}, 0, "committed: record r2 is in force"),
        (REVIEW | {"id": "session-2"}, 1, "no such session is under way"),
        (COLLECTING | {"id": "", "phase": "idle"}, 1, "no such session is under way"),
    ],
)
def test_the_exit_code_states_how_the_session_ended(last: dict[str, Any], code: int, said: str) -> None:
    out = io.StringIO()
    assert watch_session(ScriptedLink(COLLECTING, last), "session-1", out) == code
    assert said in out.getvalue()


def test_outside_a_terminal_each_change_is_one_line() -> None:
    out = io.StringIO()
    moving = COLLECTING | {"pose_fraction": 0.7, "seconds_left": 1.0}
    watch_session(
        ScriptedLink(COLLECTING, moving, moving | {"poses": [POSE, POSE | {"face": "-x"}]}, REVIEW), None, out
    )
    lines = out.getvalue().splitlines()
    assert lines[:2] == ["1 of 6 poses; hold still", "2 of 6 poses; hold still"]
    assert "since r1: offset +0.1 mg" in out.getvalue()
    assert "\r" not in out.getvalue()


def test_a_terminal_gets_a_bar() -> None:
    out = TerminalText()
    watch_session(ScriptedLink(COLLECTING, REVIEW), None, out)
    assert "1/6 [######------------------] still 2 s left next -y up; hold still" in out.getvalue()


def test_only_different_used_faces_are_counted() -> None:
    out = TerminalText()
    poses = [POSE, POSE, POSE | {"face": None, "used": False}]
    again = COLLECTING | {"poses": poses, "pose_fraction": 0.0}
    watch_session(ScriptedLink(again, REVIEW), None, out)
    assert "\x1b[K1/6 [####------" in out.getvalue()
    several = again | {"method": "norm-fit", "wanted": 12}
    watch_session(ScriptedLink(several, REVIEW), None, out)
    assert "\x1b[K2/12 [####------" in out.getvalue()


def test_on_a_narrow_terminal_the_bar_stays_one_line() -> None:
    """What wraps is not written over: the terminal itself, of 60 columns, sees nothing wider."""
    master, slave = pty.openpty()
    ioctl(slave, termios.TIOCSWINSZ, struct.pack("4H", 24, 60, 0, 0))
    with os.fdopen(slave, "w") as out:
        watch_session(ScriptedLink(COLLECTING | {"text": "a long way to go " * 9}, REVIEW), None, out)
        seen = ""
        while "in review" not in seen:
            seen += os.read(master, 4096).decode()
    os.close(master)
    bar = next(part for part in seen.split("\r\x1b[K") if "[####" in part)
    assert len(bar) == 59
    assert "next -y up" in bar


def test_the_display_waits_for_a_lost_gateway() -> None:
    link, out = ScriptedLink(COLLECTING, None, None, COLLECTING, REVIEW), io.StringIO()
    assert watch_session(link, "session-1", out) == 0
    assert out.getvalue().count("no answer from the gateway; waiting for it") == 1
    assert link.reconnects == 2


def test_ctrl_c_states_that_the_session_continues() -> None:
    class Interrupted(ScriptedLink):
        def reconnect(self) -> bool:
            raise KeyboardInterrupt

    out = io.StringIO()
    with pytest.raises(KeyboardInterrupt):
        watch_session(Interrupted(COLLECTING, None), "session-1", out)
    assert "the session continues" in out.getvalue()


BEFORE = COLLECTING | {"id": "", "phase": "idle"}


def test_an_answer_from_before_the_session_does_not_end_it() -> None:
    out = io.StringIO()
    assert watch_session(ScriptedLink(BEFORE, BEFORE, COLLECTING, REVIEW), "session-1", out) == 0
    assert "no such session" not in out.getvalue()


def test_a_gateway_with_another_session_has_no_such_session() -> None:
    out = io.StringIO()
    assert watch_session(ScriptedLink(*[BEFORE] * 9), "session-1", out) == 1
    assert "no such session is under way" in out.getvalue()
