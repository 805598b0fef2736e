"""Reports of a recorded crane."""

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.incident.folder import IncidentReport, write_report
from gateway.incident.page import NOT_VERIFIED
from gateway.incident.selection import IncidentChoice, choose_window, read_incidents
from gateway.recording.catalogue import open_timeline

MARGIN_S = 15.0
MakeReport = Callable[..., IncidentReport]


@pytest.fixture
def make_report(tmp_path: Path) -> MakeReport:
    def make(paths: list[Path], choice: IncidentChoice | None = None, margin_s: float = MARGIN_S) -> IncidentReport:
        timeline = open_timeline(paths)
        window = choose_window(timeline, read_incidents(timeline), choice or IncidentChoice(), margin_s)
        return write_report(
            timeline, window, tmp_path / "report", verification=NOT_VERIFIED, computed={"Made by": "a test"}
        )

    return make
