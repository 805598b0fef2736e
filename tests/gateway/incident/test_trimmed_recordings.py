"""Reports of recordings that the quota has trimmed: no sentence says more than what is left of them."""

import json
import shutil
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.incident.incident_report import IncidentReport
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.export.gaps import AbsenceCauses
from gateway.recording.export.recording_info import summarise_timeline
from gateway.recording.reading.interval import iso_utc
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.compaction import compact, trim
from gateway.recording.segments.events import EventInterval, append_event_interval
from tests.clocks import START_NS
from tests.gateway.incident.conftest import MakeReport, write_report_of
from tests.gateway.recorded_crane import RecordedCrane
from tests.values import present

pytestmark = pytest.mark.slow

KEPT_S = ((13.0, 16.0), (24.0, 30.0), (34.0, 36.0))
"""Of the files from the second on, in seconds from the start; the first one, with the raise and the peak, is deleted."""
BY_QUOTA = "deleted by the quota"


@pytest.fixture(scope="module")
def trimmed(recorded: RecordedCrane, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trimmed") / "data"
    shutil.copytree(recorded.folder, folder)
    first, *others = sorted(folder.glob("*.mcap"))
    chain = SegmentChain(folder, "yard/crane-2/hook", load_or_create_key(folder / "signing-key.pem"))
    chain.restore([*reversed(others), first])
    for path in others:
        compact(path, chain)
    first.unlink()
    chain.note_deletion(1, "quota", 1.5)
    for path, (begin_s, end_s) in zip(others, KEPT_S, strict=False):
        append_event_interval(path, EventInterval(START_NS + round(begin_s * 1e9), START_NS + round(end_s * 1e9)))
        trim(path, chain)
    return folder


@pytest.fixture(scope="module")
def report(trimmed: Path) -> IncidentReport:
    return write_report_of([trimmed], folder=trimmed.parent / "report")


def test_what_was_before_the_recordings_is_not_stated_of_what_is_left(
    recorded: RecordedCrane, report: IncidentReport
) -> None:
    text, content = " ".join(report.sentences), report.content
    largest_deg = present(recorded.changes[-1].largest_deg)
    largest_upper_deg = present(recorded.changes[-1].largest_upper_deg)
    assert content["limit_answer"] == "may_have_been"
    assert content["peak"]["angle_deg"] < largest_deg
    assert content["largest_deg"] == pytest.approx(largest_deg, abs=0.001)
    assert (content["is_raised_before"], content["is_whole"]) == (True, False)
    assert content["utc"]["limit_reached"] is None
    assert f"what was before: {BY_QUOTA}." in report.sentences[1]
    assert "had stood so since 2026-01-01 00:00:" in text
    assert "The largest known angle" in text
    assert f"By the alert itself it was {largest_deg:.2f}°, at most {largest_upper_deg:.2f}°" in text
    (answer,) = (each for each in report.sentences if each.startswith("It may have reached the limit of 5.0°: "))
    assert answer.endswith("; a part of the incident is not in the recordings.")
    assert "that raised it" not in text
    assert f"The gateway's own words: {recorded.changes[-1].change}" in text


def test_the_time_before_the_recordings_exonerates_nobody(report: IncidentReport) -> None:
    assert "neither the pivot nor the winch was seen to move" not in " ".join(report.sentences)
    (sentence,) = (each for each in report.sentences if each.startswith("What moved the load cannot be told: "))
    assert sentence.endswith(f"s of the 20 s before the largest known angle are not known ({BY_QUOTA}).")
    assert report.content["unseen_before_peak_s"] > 15.0


def test_the_time_before_the_report_exonerates_nobody_either(recorded: RecordedCrane, make_report: MakeReport) -> None:
    report = make_report([recorded.folder], margin_s=0.5)
    (sentence,) = (each for each in report.sentences if "s of the 20 s before the peak are not known" in each)
    assert sentence.startswith(("Other moves are possible: ", "What moved the load cannot be told: "))
    assert sentence.endswith("(before the time of this report).")


def test_each_gap_is_named_with_its_cause_and_no_state_lasts_through_it(trimmed: Path, report: IncidentReport) -> None:
    missing = report.content["samples"]["missing"]
    assert [each["cause"] for each in missing] == [BY_QUOTA] * 3
    assert [round(float(each["to"][17:-1])) for each in missing] == [24, 34, 40]
    page = (report.folder / "incident.html").read_text()
    assert f"Hatched: no samples ({BY_QUOTA})" in page
    assert f"s: {BY_QUOTA}." in page
    assert [gap.cause for gap in summarise_timeline(open_timeline([trimmed])).gaps] == [BY_QUOTA] * 3


def test_a_file_that_somebody_else_has_removed_is_not_laid_to_the_quota(
    trimmed: Path, make_report: MakeReport, tmp_path: Path
) -> None:
    left = shutil.copytree(trimmed, tmp_path / "left")
    sorted(left.glob("*.mcap"))[1].unlink()
    (missing,) = make_report([left]).content["samples"]["missing"]
    assert missing["cause"] == "not in these files"


def test_the_list_says_which_incident_was_raised_before(trimmed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "incident", str(trimmed), "--list", "--json", "-"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["is_raised_before"] is True
    assert row["raised"] < iso_utc(START_NS + 11 * 10**9)
    assert main(["record", "incident", str(trimmed), "--list"]) == 0
    assert "  before 2026-01-01T00:00:" in capsys.readouterr().out
    assert main(["record", "info", str(trimmed)]) == 0
    assert "  since  2026-01-01 00:00:" in capsys.readouterr().out


def test_the_begin_of_a_run_is_no_loss(recorded: RecordedCrane) -> None:
    segment = open_timeline([recorded.folder]).segments[0]
    assert AbsenceCauses().before(segment, 0) == "the gateway was started"
