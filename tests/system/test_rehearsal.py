"""The recalibration that the guide rehearses: the simulated rigger does what an engineer asks for, twice in a row."""

import time

import pytest

from tests.command_lines import command_words
from tests.documentation.examples import ROOT, sections
from tests.system.conftest import JoinBus, Plumbline, StartGateway
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

GUIDE = ROOT / "docs" / "guides" / "service" / "recalibration.md"


def _steps() -> list[list[str]]:
    """Return the commands of the guide's rehearsal, without the program's name."""
    return [command_words(command.text)[1:] for command in sections(GUIDE)["Rehearse it"]]


def test_the_steps_of_the_guide_succeed_on_the_demonstration(
    start_gateway: StartGateway, join_bus: JoinBus, plumbline: Plumbline
) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("condition")
    steps = _steps()
    assert [step[1] for step in steps] == ["recalibrate", "commit", "zero"]
    for _ in range(2):
        for step in steps:
            command = (*step, "--connect", gateway.endpoint)
            deadline_s = time.monotonic() + 2 * PATIENCE_S
            while (done := plumbline(*command)).returncode != 0 and "static for" in done.stderr:
                assert time.monotonic() < deadline_s
                time.sleep(2.0)
            assert done.returncode == 0, (step, done.stdout, done.stderr)
    alert = peer.wait_for("alert", lambda alert: alert["level"] != "unknown")
    assert alert["level"] == "normal"
