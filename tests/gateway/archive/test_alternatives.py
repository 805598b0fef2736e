"""What another version or another calibration would have told: ranked by what an operator would have seen."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import gateway
from gateway import __version__
from gateway.archive.alternatives import change_between
from gateway.calibration.record import CalibrationRecord, content_hash
from gateway.cli.main import main
from gateway.errors import BAD_INPUT
from gateway.recording.format.segment_summary import RecordedPeak
from gateway.recording.format.summary_builder import RecordedAlert
from gateway.recording.replay.replay_result import ReplayOutcome
from tests.gateway.archive.small_recordings import indexed, select
from tests.gateway.recorded_crane import RecordedCrane

OTHER_VERSION = "0.1.9"
BEGIN_NS = 1_767_225_600_000_000_000


def alert(begin_s: float = 10.0, level: str = "trip", rule: str = "swing") -> RecordedAlert:
    return RecordedAlert(
        rule=rule,
        level=level,
        from_utc_ns=BEGIN_NS + round(begin_s * 1e9),
        to_utc_ns=None,
        is_raised_before=False,
        ended="standing",
        largest_deg=6.0,
        largest_upper_deg=6.2,
        limit_deg=5.0,
        is_corrected=False,
        incident=None,
        text="",
    )


def outcome(*alerts: RecordedAlert, angle_deg: float | None = 6.0, unknown_s: float = 2.0) -> ReplayOutcome:
    angle = None if angle_deg is None else RecordedPeak(BEGIN_NS, angle_deg, 0.1)
    return ReplayOutcome(list(alerts), angle, None, unknown_s, {})


def test_what_an_operator_cannot_see_is_no_change() -> None:
    assert not change_between(outcome(alert(10.0)), outcome(alert(11.0), angle_deg=6.0004, unknown_s=2.05))


def test_missed_added_and_other_alerts_are_told_apart() -> None:
    before = outcome(alert(10.0), alert(60.0), alert(90.0, "warn"))
    after = outcome(alert(10.0, "warn"), alert(30.0, "warn"), alert(60.0))
    found = change_between(before, after)
    assert found.missed == (alert(90.0, "warn"),)
    assert found.added == (alert(30.0, "warn"),)
    assert found.other_level == ((alert(10.0), alert(10.0, "warn")),)


def test_the_rank_is_by_trips_missed_then_alerts_missed_added_of_another_level_then_angle_then_time() -> None:
    trip, warning = alert(10.0), alert(10.0, "warn")
    worst_first = [
        (outcome(trip), outcome()),
        (outcome(warning), outcome()),
        (outcome(), outcome(trip)),
        (outcome(trip), outcome(warning)),
        (outcome(angle_deg=None), outcome(angle_deg=6.0)),
        (outcome(), outcome(angle_deg=5.0)),
        (outcome(), outcome(unknown_s=60.0)),
        (outcome(), outcome()),
    ]
    ranks = [change_between(*pair).rank for pair in worst_first]
    assert ranks == sorted(ranks, reverse=True)
    assert len(set(ranks)) == len(ranks)


@pytest.fixture
def archive(recorded: RecordedCrane, tmp_path: Path) -> Path:
    """The table of one crane with an alert; the recordings are in `tmp_path / "source"`."""
    shutil.copytree(recorded.folder, tmp_path / "source")
    indexed(tmp_path / "source", tmp_path / "table")
    return tmp_path / "table"


def replayed(archive: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    capsys.readouterr()
    source = archive.parent / "source"
    assert main(["archive", "replay", str(source), "--table", str(archive), *options, "--json", "-"]) == 0
    content: dict[str, Any] = json.loads(capsys.readouterr().out)
    return content


def other_version(folder: Path) -> Path:
    """A checkout of another version, which compares an angle with its limits four degrees too low."""
    root = Path(gateway.__file__).parents[1]
    for package in ("gateway", "devices"):
        shutil.copytree(root / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    for file, before, after in (
        ("gateway/__init__.py", f'"{__version__}"', f'"{OTHER_VERSION}"'),
        ("gateway/stages/alerts.py", "cls(angle_rad + factor * u_rad", "cls(angle_rad - 0.07"),
    ):
        text = (folder / file).read_text()
        assert text.count(before) == 1
        (folder / file).write_text(text.replace(before, after))
    return folder


@pytest.mark.slow
def test_a_version_that_missed_an_alert_is_told_from_this_one(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The other version is a real one: a checkout of its own, in a process of its own."""
    as_recorded = replayed(archive, capsys, "--against-version")["changes"]
    assert (as_recorded["compared"], as_recorded["changed"]) == (1, [])
    nothing_yet = replayed(archive, capsys, "--against-version", OTHER_VERSION)["changes"]
    assert (nothing_yet["compared"], nothing_yet["not_compared"]) == (0, 1)
    command = [sys.executable, "-m", "gateway", "archive", "replay", tmp_path / "source", "--table", archive]
    checkout = other_version(tmp_path / "checkout")
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    subprocess.run([*map(str, command), "--against-version"], cwd=checkout, env=environment, check=True)
    assert select(archive, "SELECT software, verdict FROM results ORDER BY 1") == [
        (OTHER_VERSION, "differs"),
        (__version__, "equal"),
    ]
    (change,) = replayed(archive, capsys, "--against-version", OTHER_VERSION)["changes"]["changed"]
    assert (change["gateway"], change["software"], change["missed"]) == ("yard/crane-2/hook", __version__, [])
    assert change["added"]
    assert [alert["level"] for alert in change["added"]] == ["trip"]
    page = tmp_path / "report.html"
    arguments = ["archive", "report", "--table", str(archive), "--html", str(page)]
    assert main([*arguments, "--from", "2026-01-01", "--to", "2026-01-02"]) == 0
    assert f"<td>{OTHER_VERSION}</td>" in page.read_text()  # against what was recorded
    assert f"<td>{__version__}</td>" not in page.read_text()


@pytest.mark.slow
def test_a_calibration_that_lowers_the_angle_is_told_from_the_recorded_one(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ((text,),) = select(archive, "SELECT DISTINCT record FROM calibrations")
    content = json.loads(text)
    content["id"] = "half"
    content["correction_matrix"] = [
        [0.5 * each for each in row] if place < 2 else row for place, row in enumerate(content["correction_matrix"])
    ]
    content["sha256"] = content_hash(content)
    path = tmp_path / "half.json"
    path.write_text(CalibrationRecord.model_validate(content).model_dump_json())
    found = replayed(archive, capsys, "--calibration", str(path), "--against-version")
    (change,) = found["changes"]["changed"]
    assert (change["calibration"], found["verdicts"]) == ("half", {"differs": 1})
    assert change["angle_deg"][1] < change["angle_deg"][0]
    assert replayed(archive, capsys)["known"] == 0  # the recorded calibration is another task
    again = replayed(archive, capsys, "--calibration", str(path), "--against-version", __version__)
    assert again["known"] == 1
    assert len(again["changes"]["changed"]) == 1


@pytest.mark.slow
def test_a_calibration_of_another_device_is_refused(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ((text,),) = select(archive, "SELECT DISTINCT record FROM calibrations")
    content = json.loads(text) | {"device_id": "other-part"}
    content["sha256"] = content_hash(content)
    path = tmp_path / "other.json"
    path.write_text(CalibrationRecord.model_validate(content).model_dump_json())
    source = archive.parent / "source"
    arguments = ["archive", "replay", str(source), "--table", str(archive), "--calibration", str(path)]
    assert main(arguments) == BAD_INPUT
    assert "no recording is of its device, other-part" in capsys.readouterr().err
