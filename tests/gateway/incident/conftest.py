"""Reports of a recorded crane."""

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.incident.evidence import judge_recordings
from gateway.incident.incident_report import IncidentReport, write_report
from gateway.incident.incident_selection import IncidentChoice, choose_window, read_incidents
from gateway.recording.reading.timeline import open_timeline

MARGIN_S = 15.0
MakeReport = Callable[..., IncidentReport]


@pytest.fixture
def make_report(tmp_path: Path) -> MakeReport:
    def make(
        paths: list[Path], choice: IncidentChoice | None = None, margin_s: float = MARGIN_S, key: str | None = None
    ) -> IncidentReport:
        timeline = open_timeline(paths)
        window = choose_window(timeline, read_incidents(timeline), choice or IncidentChoice(), margin_s)
        return write_report(
            timeline,
            window,
            tmp_path / "report",
            verify=lambda sources: judge_recordings(sources, key),
            computed={"Made by": "a test"},
        )

    return make
