"""What the page reports about signing in becomes counts, lines of the security log, and a fault."""

import json
from pathlib import Path

import pytest

from gateway.daemon.commands.rpc_server import PIN_GUESSED, SignInWatch
from gateway.daemon.commands.security import SecurityLog
from gateway.daemon.runtime.worker import FaultRegister


@pytest.mark.parametrize(("state", "words"), [("replaced", "has a new one"), ("void", "no new one can be written")])
def test_wrong_pins_are_counted_and_a_void_pin_is_a_fault_until_somebody_signs_in(
    tmp_path: Path, state: str, words: str
) -> None:
    log, faults, pin_file = SecurityLog(tmp_path / "security.jsonl"), FaultRegister(), tmp_path / "page-pin"
    watch = SignInWatch(log, faults, pin_file, lambda: 0)

    def report(wrong: int, pin: str | None) -> None:
        watch.take(json.dumps({"wrong": wrong, "address": "10.0.0.9", "pin": pin}).encode())

    report(3, None)
    assert faults.standing == {}
    report(997, state)
    assert log.counts == {"wrong_pin": 1000}
    (line,) = (tmp_path / "security.jsonl").read_text().splitlines()
    assert json.loads(line)["origin"] == "10.0.0.9"
    assert words in faults.standing[PIN_GUESSED]
    assert str(pin_file) in faults.standing[PIN_GUESSED]
    watch.take(b"no report")
    report(0, "good")
    assert faults.standing == {}
