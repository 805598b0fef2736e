"""The aligning assistant in a terminal and in a file: what is shown, and when it ends."""

import io
import json
import time
from collections.abc import Callable
from typing import Any

import pytest

from gateway.bus.client import GatewayClient
from gateway.calibration.alignment.assistant import ScrewMechanics
from gateway.cli.remote import remote_align as aligning
from gateway.cli.remote.remote_align import SILENCE_TEXT, show_advice
from gateway.messages import Tilt
from gateway.topics import encode
from tests.gateway.cli.terminal import TerminalText


def tilt(number: int, pitch_deg: float, roll_deg: float, **changes: Any) -> dict[str, Any]:
    content: dict[str, Any] = {
        "time_ns": number * 100_000_000,
        "clock": "synchronised",
        "sequence": number,
        "calibration_id": "r1",
        "pitch_deg": pitch_deg,
        "roll_deg": roll_deg,
        "axial_deg": 1.0,
        "u_deg": 0.05,
        "direction_deg": 0.0,
        "specific_force_g": [0.0, 0.0, 1.0],
        "temperature_c": None,
        "delay_s": 0.2,
        "trusted": True,
    }
    fields: dict[str, Any] = json.loads(encode(Tilt(**(content | changes))))
    return fields


class ScriptedGateway(GatewayClient):
    """Sends one batch of tilts for each subscription."""

    def __init__(self, *batches: Any) -> None:
        self._batches = list(batches)
        self.reconnects = 0

    def subscribe(self, topic: str, take: Callable[[Any], object]) -> None:
        for sample in self._batches.pop(0):
            take(sample)

    def reconnect(self) -> bool:
        self.reconnects += 1
        return self.reconnects > 1


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(aligning, "TILT_SILENCE_S", 0.01)
    monkeypatch.setattr(time, "sleep", lambda _: None)


MOVING = [tilt(number, 0.3, -1.5, trusted=False) for number in range(5)]
TURN = [tilt(number, 0.3, -1.5) for number in range(5, 20)]
ALIGNED = [tilt(number, 0.01, 0.02) for number in range(60, 80)]


def test_it_ends_when_both_angles_are_aligned_and_states_their_uncertainty() -> None:
    out = io.StringIO()
    assert show_advice(ScriptedGateway([*MOVING, *TURN, *ALIGNED]), ScrewMechanics(), out) == 0
    lines = out.getvalue().splitlines()
    assert len(lines) == 5  # moves, is averaged, is to be turned, is averaged, is aligned
    assert "no advice while the load moves" in lines[0]
    assert lines[2] == "pitch +0.300  roll -1.500 deg: turn the roll screw in by 2.09 turns"
    assert "aligned: within 0.030 deg" in lines[-1]
    assert "u = 0.050 deg" in lines[-1]


def test_it_waits_for_a_lost_gateway() -> None:
    gateway, out = ScriptedGateway(TURN, ALIGNED), io.StringIO()
    assert show_advice(gateway, ScrewMechanics(), out) == 0
    assert out.getvalue().count(SILENCE_TEXT) == 1
    assert gateway.reconnects == 2


def test_a_terminal_shows_one_line_of_its_width(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    out = TerminalText()
    assert show_advice(ScriptedGateway([*TURN, *ALIGNED]), ScrewMechanics(), out) == 0
    *moving, _last, _end = out.getvalue().split("\r\x1b[K")
    assert max(map(len, moving)) <= 59
