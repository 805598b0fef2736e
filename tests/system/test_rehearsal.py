"""The recalibration that the guide rehearses: the simulated rigger does what an engineer asks for, twice in a row."""

import re
import time
from pathlib import Path

import pytest

from tests.system.conftest import JoinBus, Plumbline, StartGateway
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "service" / "recalibration.md"


def _steps() -> list[list[str]]:
    """Return the commands of the guide's rehearsal, without the program's name."""
    section = GUIDE.read_text(encoding="utf-8").partition("## Rehearse it\n")[2].partition("\n## ")[0]
    lines = re.findall(r"^    plumbline (remote .*?)(?:\s+#.*)?$", section, re.MULTILINE)
    return [line.split() for line in lines]


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
