"""Restarts and changed settings in a report: what a run states ends with it, and what a hole hides is no restart."""

import re
from pathlib import Path

import numpy as np
import pytest

from gateway.incident.gateway_runs import RunRegister
from gateway.incident.incident_report import IncidentReport
from gateway.incident.incident_selection import IncidentChoice
from gateway.incident.incident_summary import restart_text
from gateway.incident.sample_gaps import TimeGap
from gateway.incident.timeline_figure import ReportClock
from gateway.recording.export.gaps import MISSING_INSIDE, NOT_ARRIVED, NOT_GIVEN, RESTARTED
from gateway.recording.reading.interval import RecordingInterval, parse_recording_time
from tests.gateway.incident.conftest import text_of, write_report_of
from tests.gateway.incident.stated import ORIGIN_NS, built, calibration, health

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


def test_a_hole_behind_a_restart_is_no_time_in_which_alerts_were_not_judged() -> None:
    """The health messages before and behind it say nothing of alerts; the first known level is behind the hole."""
    runs = RunRegister()
    for time_s, boot_id in ((0.0, "a"), (5.0, "a"), (20.0, "b"), (110.0, "b")):
        runs.add(time_s, boot_id)
    clock = ReportClock(built((0.0, health())).course(ORIGIN_NS, ORIGIN_NS + 120_000_000_000))
    levels = {"swing": runs.states(np.array([20.5, 100.0]), ("unknown", "normal"))}

    def told(hole: TimeGap) -> str:
        return restart_text(clock, runs.restarts(runs.states(np.array([1.0]), ("running",)), levels, [hole])[0])

    damaged = told(TimeGap(21.0, 95.0, MISSING_INSIDE))
    assert "; from 00:00:21.0 to 00:01:35.0 UTC the recordings have a gap" in damaged
    assert damaged.endswith("so that whether alerts were judged then is not known.")
    for judged in (TimeGap(21.0, 95.0, NOT_ARRIVED), TimeGap(101.0, 105.0, MISSING_INSIDE)):
        assert told(judged).endswith(": alerts were not judged for 95.0 s.")


def test_a_suspension_behind_a_restart_is_told_apart() -> None:
    runs = RunRegister()
    for time_s, boot_id in ((0.0, "a"), (5.0, "a"), (20.0, "b"), (110.0, "b")):
        runs.add(time_s, boot_id)
    session = built((0.0, health()), (30.0, calibration(id="s1", phase="collecting", by="Ann", suspended=True)))
    clock = ReportClock(session.course(ORIGIN_NS, ORIGIN_NS + 120_000_000_000))
    levels = {"swing": runs.states(np.array([20.5, 100.0]), ("unknown", "normal"))}
    (restart,) = runs.restarts(runs.states(np.array([1.0]), ("running",)), levels, [])
    assert restart_text(clock, restart).endswith(": alerts were not judged for 25.0 s, until they were suspended.")


def test_the_state_of_the_gateway_has_the_time_at_which_it_was_stated(report_of_restarts: IncidentReport) -> None:
    page = text_of(report_of_restarts.folder / "incident.html")
    assert re.search(r"State as last stated running, at 2026-01-01T00:00:\d\d\.\d+Z", page)


def test_a_change_of_the_limit_before_the_alert_is_told_in_words(report_of_restarts: IncidentReport) -> None:
    report = report_of_restarts
    assert (
        "Before it, the trip limit of the swing was changed from 6.0° to 5.0° by ann at 00:00:07.2 UTC, with the words: "
        "crane <b>7</b>; in force from 2026-01-01 00:00:10.3 UTC on, 9.7 s before the trip."
    ) in report.sentences
    page = text_of(report.folder / "incident.html")
    assert "log Settings changed by ann: alerts.trip_deg: 6.0 -> 5.0, with the words: crane <b>7</b>" in page
    assert '{"time_utc"' not in page
