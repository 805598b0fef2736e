"""`plumbline doctor` says what keeps the relay from working, and switches nothing; suspended alerts are told."""

from pathlib import Path
from typing import Any

import pytest

from gateway.bus.client import StatusAnswer
from gateway.configuration.model import Configuration
from gateway.daemon.doctor import service_check
from gateway.daemon.doctor.checks import check_relay
from tests.gateway.daemon.outputs.relay_script import ScriptedRelay


def check(**relay: object) -> list[tuple[str, str]]:
    return [(result.grade, result.text) for result in check_relay(Configuration.model_validate({"relay": relay}))]


def test_without_a_relay_there_is_nothing_to_check() -> None:
    assert check(kind="none") == []


def test_a_command_is_found_and_not_called(tmp_path: Path) -> None:
    relay = ScriptedRelay(tmp_path)
    ((grade, _),) = check(kind="command", command=[str(relay.path)])
    assert (grade, relay.calls) == ("good", [])


@pytest.mark.parametrize(
    ("relay", "problem"),
    [
        ({"kind": "command", "command": ["/no/such/program"]}, "no such program"),
        ({"kind": "gpio", "chip": "/dev/no-such-chip", "line": 1}, "no such GPIO chip"),
    ],
)
def test_an_output_that_is_not_there_is_bad(relay: dict[str, object], problem: str) -> None:
    ((grade, text),) = check(**relay)
    assert grade == "bad"
    assert problem in text


def test_limits_that_are_not_those_of_commissioning_are_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    changed = ["alerts.trip_deg is 14, and was 5.5"]
    topics: dict[str, dict[str, Any]] = {
        "health": {"state": "running", "uptime_s": 9, "software": "0", "changed_limits": changed}
    }
    monkeypatch.setattr(service_check, "query_gateway", lambda _: StatusAnswer(topics=topics, doubt=None))
    limits = next(result for result in service_check.examine_running(Configuration()) if result.place == "limits")
    assert (limits.grade, limits.text) == ("note", f"not those of commissioning: {changed[0]}")


@pytest.mark.parametrize(("phase", "grade"), [("collecting", "note"), ("review", "note"), ("rejected", "bad")])
def test_alerts_that_nobody_is_about_to_raise_again_are_bad(
    phase: str, grade: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    topics: dict[str, dict[str, Any]] = {
        "alert": {"level": "unknown", "validity": "suspended", "text": "swing unknown: SUSPENDED"},
        "calibration": {"status": "factory", "session": {"phase": phase}},
    }
    monkeypatch.setattr(service_check, "query_gateway", lambda _: StatusAnswer(topics=topics, doubt=None))
    alerts = next(result for result in service_check.examine_running(Configuration()) if result.place == "alerts")
    assert alerts.grade == grade
