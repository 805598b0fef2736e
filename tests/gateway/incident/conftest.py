"""Reports of a recorded crane."""

import re
from collections.abc import Callable
from functools import partial
from html import unescape
from pathlib import Path

import pytest

from gateway.incident.incident_report import IncidentReport, write_report
from gateway.incident.incident_selection import IncidentChoice, choose_window, read_incidents
from gateway.incident.record_verdict import judge_recordings
from gateway.recording.format import mcap_writer
from gateway.recording.reading.timeline import open_timeline
from tests.gateway.recorded_crane import RecordedCrane

MARGIN_S = 15.0
MakeReport = Callable[..., IncidentReport]


def write_report_of(
    paths: list[Path],
    choice: IncidentChoice | None = None,
    margin_s: float = MARGIN_S,
    key: str | None = None,
    *,
    folder: Path,
) -> IncidentReport:
    timeline = open_timeline(paths)
    window = choose_window(timeline, read_incidents(timeline), choice or IncidentChoice(), margin_s)
    return write_report(
        timeline, window, folder, verify=lambda sources: judge_recordings(sources, key), computed={"Made by": "a test"}
    )


def text_of(page: Path) -> str:
    """The words of a page."""
    without_style = re.sub(r"(?s)<style.*?</style>", "", page.read_text())
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", without_style)))


@pytest.fixture
def make_report(tmp_path: Path) -> MakeReport:
    return partial(write_report_of, folder=tmp_path / "report")


@pytest.fixture(scope="session")
def report(recorded: RecordedCrane, tmp_path_factory: pytest.TempPathFactory) -> IncidentReport:
    """The report of the whole incident, for tests that only read it."""
    return write_report_of([recorded.folder], folder=tmp_path_factory.mktemp("incident") / "report")


@pytest.fixture(scope="session")
def report_of_restarts(restarted: Path, tmp_path_factory: pytest.TempPathFactory) -> IncidentReport:
    """The report of three runs, one of which has another configuration; what it cuts out has several chunks."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(mcap_writer, "CHUNK_BYTES", 30_000)
        return write_report_of([restarted], margin_s=20.0, folder=tmp_path_factory.mktemp("restarts") / "report")
