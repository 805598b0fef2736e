"""The sentences of an incident's summary, from single messages."""

from dataclasses import replace

import pytest

from gateway.incident.facts import incident_facts
from gateway.incident.incident_selection import find_incidents
from gateway.incident.incident_summary import summary_sentences, suspension_texts
from gateway.incident.timeline_figure import ReportClock
from gateway.messages import (
    Motion,
)
from tests.gateway.incident.stated import HEAD, ORIGIN_NS, active, alert, built, calibration


def test_a_recalibration_during_an_alert_is_told_in_words() -> None:
    course = built(
        (0.0, calibration()),
        (1.0, calibration(id="s1", phase="collecting", by="Ann", suspended=True)),
        (5.5, calibration(id="s1", phase="review", by="Ann", suspended=True)),
        (9.0, calibration(id="s1", phase="committed", by="Ann")),
    ).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    (text,) = suspension_texts(course, ReportClock(course))
    assert text.startswith("From ")
    assert " or b" not in text
    assert text.endswith("because the sensor was recalibrated by Ann: how the load swung then is not known.")
    assert [(begin_s, end_s) for begin_s, end_s, by in course.suspended.spans(12.0) if by] == [(1.0, 9.0)]


def test_a_recalibration_that_reaches_beyond_a_report_has_no_begin_and_no_end() -> None:
    course = built(
        (0.0, calibration(id="s1", phase="collecting", by="Ann", suspended=True)),
        (5.5, calibration(id="s1", phase="review", by="Ann", suspended=True)),
    ).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    (text,) = suspension_texts(course, ReportClock(course))
    assert " or before to the end of this report or beyond it alerts were suspended" in text


@pytest.mark.parametrize(
    ("unknown", "expected"), [(5, "The largest angle between"), (30, "The largest known angle between")]
)
def test_an_angle_that_was_not_known_for_a_part_may_have_been_larger(unknown: int, expected: str) -> None:
    """Ten messages a second; up to a second without an angle is no loss of sight, as for an alert."""
    angles_deg = [6.0] * 40 + [None] * unknown + [5.0] * 20
    motions = [Motion(**HEAD, state="free", angle_deg=each, u_deg=0.1, reasons=[], text="") for each in angles_deg]
    builder = built(*((0.1 * number, motion) for number, motion in enumerate(motions)))
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000)
    sentences = summary_sentences(course, None, incident_facts(course, None))
    (told,) = (each for each in sentences if each.startswith("The largest"))
    assert told.startswith(expected)
    assert told.endswith("for 3.0 s of the incident it was not known.") == (unknown == 30)


def test_who_acknowledged_a_warning_has_not_acknowledged_the_trip_that_followed() -> None:
    warning, trip = active("swing", "warn", "b-1"), active("swing", "trip", "b-1")
    known = replace(alert("acknowledged", "swing", warning, incident="b-1"), acknowledged_by="bob")
    stated = [
        (1.0, alert("raised", "swing", warning, incident="b-1")),
        (2.0, known),
        (4.0, alert("raised", "swing", trip, incident="b-1")),
        (9.0, alert("cleared", "swing", incident="b-1")),
    ]
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    course = built(*stated).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    told = [each for each in summary_sentences(course, found, incident_facts(course, found)) if "acknowledge" in each]
    assert len(told) == 1
    assert told[0].endswith("by bob, as a warning; the recordings state no acknowledgement of the trip.")


def test_the_end_of_an_alert_is_not_known_where_the_recordings_end_before_it() -> None:
    trip = active("swing", "trip", "b-1")
    stated = [(1.0, alert("raised", "swing", trip, incident="b-1")), (4.0, alert("standing", None, trip))]
    motions = [
        (0.1 * n, Motion(**HEAD, state="free", angle_deg=5.0, u_deg=0.1, reasons=[], text="")) for n in range(45)
    ]
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    course = built(*motions, *stated).course(ORIGIN_NS, ORIGIN_NS + 4_400_000_000)
    facts = incident_facts(course, found)
    (told,) = (each for each in summary_sentences(course, found, facts) if each.startswith("The largest"))
    assert "was at least 5.00°" in told
    assert told.endswith(": what came after 00:00:04.0 is not known.")
    assert facts.is_open
