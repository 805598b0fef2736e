"""Restarts and changed settings in a report: what a run states ends with it, and what a hole hides is no restart."""

import re
from pathlib import Path

import numpy as np
import pytest

from gateway.incident.gateway_runs import RunRegister
from gateway.incident.incident_report import IncidentReport
from gateway.incident.incident_selection import IncidentChoice
from gateway.incident.sample_gaps import TimeGap
from gateway.recording.export.gaps import NOT_GIVEN, RESTARTED
from gateway.recording.reading.interval import RecordingInterval, parse_recording_time
from tests.gateway.incident.conftest import text_of, write_report_of

pytestmark = pytest.mark.slow


def test_a_restart_ends_what_was_stated_before_and_is_told_in_words(report_of_restarts: IncidentReport) -> None:
    report = report_of_restarts
    assert report.sentences[-5:-3] == (
        "The gateway was stopped at 2026-01-01 00:00:08.2 UTC and was started again at 00:00:10.3 UTC: "
        "alerts were not judged for 4.5 s.",
        "The gateway stopped without notice (recorded up to 2026-01-01 00:00:25.3 UTC; it may have run up to 1 s longer, "
        "or more where somebody has cut its file) and was started again at 00:00:31.3 UTC: alerts were not judged for 8.4 s.",
    )
    page = text_of(report.folder / "incident.html")
    assert set(report.sentences[-5:-3]) <= set(re.findall(r"gateway (The gateway .*?judged for \S+ s\.)", page))
    running = re.findall(r"(\S+) gateway Running for (\S+) s", page)
    ends_s = [float(from_utc[6:]) + float(length_s) for from_utc, length_s in running]
    assert ends_s == pytest.approx([7.3, 25.3, 36.2], abs=0.11)


def test_a_restart_after_the_report_is_told(restarted: Path, tmp_path: Path) -> None:
    choice = IncidentChoice(interval=RecordingInterval(parse_recording_time("16"), parse_recording_time("27")))
    report = write_report_of([restarted], choice, folder=tmp_path / "short")
    (told,) = (each for each in report.sentences if "was started again" in each)
    assert "stopped without notice (recorded up to 2026-01-01 00:00:25.3 UTC" in told
    assert told.endswith("was started again at 2026-01-01 00:00:31.3 UTC, after the time of this report.")


def test_what_a_hole_hides_is_no_restart() -> None:
    runs = RunRegister()
    for time_s, boot_id in ((0.0, "a"), (5.0, "a"), (60.0, "b"), (70.0, "b")):
        runs.add(time_s, boot_id)
    health = runs.states(np.array([1.0]), ("running",))
    (hidden,) = runs.restarts(health, {}, [TimeGap(5.2, 59.8, NOT_GIVEN)])
    (seen,) = runs.restarts(health, {}, [TimeGap(5.2, 59.8, RESTARTED)])
    assert (hidden.unseen, seen.unseen) == (NOT_GIVEN, "")


def test_a_change_of_the_limit_before_the_alert_is_told_in_words(report_of_restarts: IncidentReport) -> None:
    report = report_of_restarts
    assert (
        "Before it, the trip limit of the swing was changed from 6.0° to 5.0° by ann at 00:00:07.2 UTC, with the words: "
        "crane <b>7</b>; in force from 2026-01-01 00:00:10.3 UTC on, 9.7 s before the trip."
    ) in report.sentences
    page = text_of(report.folder / "incident.html")
    assert "log Settings changed by ann: alerts.trip_deg: 6.0 -> 5.0, with the words: crane <b>7</b>" in page
    assert '{"time_utc"' not in page
