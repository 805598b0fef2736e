"""The choice of the incident that a report is of."""

import pytest

from gateway.errors import InputError
from gateway.incident.incident_selection import IncidentChoice, choose_window, find_incidents, read_incidents
from gateway.recording.reading.interval import iso_utc, parse_recording_time
from gateway.recording.reading.timeline import open_timeline
from tests.gateway.incident.conftest import MakeReport
from tests.gateway.incident.stated import active, alert
from tests.gateway.recorded_crane import RecordedCrane
from tests.gateway.recording.recorded_crane import BOOT_ID, SECOND_NS
from tests.values import present

pytestmark = pytest.mark.slow


def test_a_time_is_reported_around_which_nothing_was_raised(recorded: RecordedCrane, make_report: MakeReport) -> None:
    report = make_report([recorded.folder], IncidentChoice(around=parse_recording_time("40")), margin_s=3.0)
    assert report.content["incident"] is None
    assert report.sentences[1].startswith("No alert was raised in this time")


@pytest.mark.parametrize("time", ["10", "20", "29"])
def test_the_incident_around_a_time_is_found(recorded: RecordedCrane, time: str) -> None:
    timeline = open_timeline([recorded.folder])
    choice = IncidentChoice(around=parse_recording_time(time))
    assert present(choose_window(timeline, read_incidents(timeline), choice, 1.0).incident).id == f"{BOOT_ID}-1"


def test_a_number_that_no_incident_has_is_refused(recorded: RecordedCrane, make_report: MakeReport) -> None:
    with pytest.raises(InputError, match=r"--alert 2: there is none in .*, which has 1 incident, numbered from 1"):
        make_report([recorded.folder], IncidentChoice(alert="2"))


@pytest.mark.parametrize(("around", "number"), [("15", 2), ("10", 1), ("11.5", 1), ("12.5", 2), ("20.5", 2)])
def test_a_time_is_of_the_incident_that_it_lies_in_or_else_of_the_nearest(
    recorded: RecordedCrane, around: str, number: int
) -> None:
    timeline = open_timeline([recorded.folder])
    first_ns = timeline.span().first_ns
    incidents = find_incidents(
        [
            (first_ns + 8 * SECOND_NS, alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")),
            (first_ns + 11 * SECOND_NS, alert("cleared", "swing", incident="b-1")),
            (first_ns + 13 * SECOND_NS, alert("raised", "swing", active("swing", "warn", "b-2"), incident="b-2")),
            (first_ns + 20 * SECOND_NS, alert("cleared", "swing", incident="b-2")),
        ]
    )
    window = choose_window(timeline, incidents, IncidentChoice(around=parse_recording_time(around)), 60.0)
    assert present(window.incident).number == number


def test_an_incident_without_an_end_is_told_beside_the_next_one(recorded: RecordedCrane) -> None:
    """However far it is from the time of the report."""
    first_ns = open_timeline([recorded.folder]).span().first_ns
    timeline = open_timeline([recorded.folder])
    incidents = find_incidents(
        [
            (first_ns + 2 * SECOND_NS, alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")),
            (first_ns + 9 * SECOND_NS, alert("raised", "swing", active("swing", "warn", "b-2"), incident="b-2")),
            (first_ns + 15 * SECOND_NS, alert("cleared", "swing", incident="b-2")),
            (first_ns + 25 * SECOND_NS, alert("raised", "swing", active("swing", "warn", "b-3"), incident="b-3")),
            (first_ns + 30 * SECOND_NS, alert("cleared", "swing", incident="b-3")),
        ]
    )
    others = [
        [other.number for other in choose_window(timeline, incidents, IncidentChoice(alert=alert), 1.0).others]
        for alert in ("1", "2", incidents[2].id)
    ]
    assert others == [[2], [1], []]


def test_a_report_says_that_no_alert_stood_at_the_time_that_was_asked_for(recorded: RecordedCrane) -> None:
    timeline = open_timeline([recorded.folder])
    incidents = read_incidents(timeline)
    first = incidents[0]
    for time_ns, is_beside in ((first.raised_ns + 1_000_000_000, False), (first.raised_ns - 2_000_000_000, True)):
        at = iso_utc(time_ns + timeline.span().wall_offset_ns)
        window = choose_window(timeline, incidents, IncidentChoice(around=parse_recording_time(at)), 60.0)
        assert (window.asked_ns is not None) == is_beside
