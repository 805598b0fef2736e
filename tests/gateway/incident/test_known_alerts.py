"""What a report says of the alerts at a time of which nothing is recorded."""

import shutil
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.recording.reading.interval import iso_utc
from tests.clocks import START_NS
from tests.gateway.incident.conftest import MARGIN_S
from tests.gateway.recorded_crane import RecordedCrane
from tests.gateway.recording.recorded_crane import CLOCK, SECOND_NS
from tests.gateway.restarted_crane import KILL_S, THIRD_START_S

pytestmark = pytest.mark.slow

UNKNOWN = "Whether an alert stood at "


def said_of(folder: Path, time_s: float, capsys: pytest.CaptureFixture[str], margin_s: float = MARGIN_S) -> str:
    """Return what is printed of a time after the start of the first run."""
    at = iso_utc(START_NS + round(time_s * SECOND_NS) + CLOCK.wall_offset_ns)
    out = folder.parent / f"report {time_s} {margin_s}"
    main(["record", "incident", str(folder), "--around", at, "--margin", str(margin_s), "--out", str(out)])
    return capsys.readouterr().out


@pytest.fixture
def copy(recorded: RecordedCrane, tmp_path: Path) -> Path:
    return shutil.copytree(recorded.folder, tmp_path / "data")


def test_a_time_in_a_hole_is_not_one_without_an_alert(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sorted(copy.glob("*.mcap"))[3].unlink()
    said = said_of(copy, 35.0, capsys)
    assert UNKNOWN in said
    assert "is not known: no recording of that time is here (not in these files)." in said
    assert "The nearest one that is known " in said
    assert "no alert stood" not in said


def test_a_time_after_the_incident_that_is_recorded_is_one_without_an_alert(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = said_of(copy, 35.0, capsys)
    assert "no alert stood; the one before had ended " in said
    assert UNKNOWN not in said


def test_of_a_time_at_which_the_gateway_was_off_it_is_not_known_whether_an_alert_stood(
    restarted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = shutil.copytree(restarted, tmp_path / "data")
    said = said_of(folder, (KILL_S + THIRD_START_S) / 2, capsys)
    assert "is not known: the gateway had stopped without notice." in said
    assert "The nearest one that is known was last stated " in said
    assert "no alert stood" not in said


def test_a_report_of_no_incident_says_where_one_may_have_been(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sorted(copy.glob("*.mcap"))[3].unlink()
    said = said_of(copy, 42.0, capsys, margin_s=5.0)
    assert "The recordings state no alert in this time, " in said
    assert "whether one stood is not known from 00:00:37.3 to 00:00:40." in said
    assert "No alert was raised" not in said
    assert UNKNOWN not in said  # at the time itself it is
