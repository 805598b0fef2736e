"""The incidents of a recording, its course and its evidence, from single messages and records.

Incidents have ids or none, and may be raised before the recordings begin.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import correction_for
from gateway.incident.course import CourseBuilder
from gateway.incident.event_table import MAX_SHOWN_EVENTS, event_table
from gateway.incident.evidence import IncidentEvidence, make_certificates
from gateway.incident.facts import incident_facts
from gateway.incident.incident_selection import STANDING, IncidentWindow, find_incidents
from gateway.incident.incident_summary import summary_sentences, suspension_texts
from gateway.incident.limit_changes import AuditEntry
from gateway.incident.timeline_figure import ReportClock, levels_in_force, tick_label, tick_times
from gateway.messages import (
    NO_SESSION,
    ActiveAlert,
    Alert,
    AlertEventKind,
    Calibration,
    ClockOffset,
    ClockQuality,
    FoxgloveTime,
    Health,
    Level,
    Log,
    Mark,
    Motion,
)
from gateway.recording.reading.recording_file import SegmentIndex
from gateway.recording.reading.sample_calibration import CalibratedBlock
from tests.gateway.calibration.test_acceptance import make_parent
from tests.gateway.certificate.conftest import sealed

ORIGIN_NS = 1_767_225_600_000_000_000
HEAD: dict[str, Any] = {"time_ns": ORIGIN_NS, "clock": "synchronised", "sequence": 0}
BEGIN_NS = 1_767_225_607_130_000_123
"""2026-01-01 00:00:07.130 UTC."""
HOSTILE = b"<script>alert(1)</script>"


def calibration(gain: float = 0.5, **session: Any) -> Calibration:
    in_force = {"gain_g_per_unit": (gain * np.eye(3)).tolist(), "bias_g": [0.0, 0.0, 1.0], "unit": "counts"}
    return Calibration(
        **HEAD,
        status="calibrated",
        device_id="part-7",
        record={},
        in_force=in_force,
        text="calibrated",
        session=replace(NO_SESSION, **session),
    )


def block(first_s: float, lost: int = 0) -> CalibratedBlock:
    """Ten samples at 10 Hz."""
    time_ns = ORIGIN_NS + np.rint((first_s + np.arange(10) / 10) * 1e9).astype(np.int64)
    samples = SampleBlock(time_ns=time_ns, raw=np.zeros((10, 3), dtype=np.int32), lost=lost)
    info = DeviceInfo(kind="adxl355", device_id="part-7", unit="counts", odr_hz=10.0, units_per_g=256e3)
    correction = correction_for(info, ((0, 1), (1, 1), (2, 1)), None)
    return CalibratedBlock(SegmentIndex(Path("one.mcap"), 0), samples, np.full((10, 3), first_s), correction, 0, 0)


def health(**changes: Any) -> Health:
    common: dict[str, Any] = {
        "state": "running",
        "device_kind": "adxl355",
        "boot_id": "b00t",
        "software": "0.1.0",
        "uptime_s": 1.0,
        "samples": 10,
        "lost": 0,
        "invalid": 0,
        "faults": {},
        "dropped": {},
    }
    return Health(**HEAD, **(common | changes))


def built(*messages: tuple[float, object]) -> CourseBuilder:
    builder = CourseBuilder(ORIGIN_NS)
    for time_s, message in messages:
        builder.add(ORIGIN_NS + round(time_s * 1e9), message)
    return builder


def test_a_missing_block_is_a_gap() -> None:
    builder = CourseBuilder(ORIGIN_NS)
    builder.add_block(block(0.0))
    builder.add_block(block(2.0, lost=10))
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 3_000_000_000)
    (gap,) = course.samples.gaps
    assert (gap.begin_s, gap.end_s) == pytest.approx((0.9, 2.0))
    assert (course.samples.count, course.samples.lost) == (20, 10)
    assert course.samples.rate_hz == pytest.approx(10.0)
    assert course.acceleration.force_g[:, 0] == pytest.approx([0.0] * 10 + [2.0] * 10)


def test_each_step_of_a_recalibration_is_stated_once_with_its_person() -> None:
    course = built(
        (0.0, calibration()),
        (1.0, calibration(id="s1", phase="collecting", by="Ann", text="Turn the housing.")),
        (2.0, calibration(id="s1", phase="collecting", by="Ann", text="Turn the housing.")),
        (3.0, calibration(id="s1", phase="committed", by="Ann", text="Done.")),
    ).course(ORIGIN_NS, ORIGIN_NS + 4_000_000_000)
    assert [(each.time_s, each.text) for each in course.sessions] == [
        (1.0, "Recalibration collecting, begun by Ann. Turn the housing."),
        (3.0, "Recalibration committed, begun by Ann. Done."),
    ]


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


def test_faults_are_stated_when_their_number_grows() -> None:
    course = built(
        (0.0, health(faults={"i2c_bus_error": 5})),
        (1.0, health(faults={"i2c_bus_error": 7}, dropped={"bus": 0})),
        (2.0, health(faults={"i2c_bus_error": 7}, dropped={"bus": 3})),
    ).course(ORIGIN_NS, ORIGIN_NS + 3_000_000_000)
    assert [(each.time_s, each.text) for each in course.faults] == [
        (1.0, "i2c bus error: 2 more"),
        (2.0, "dropped by the bus: 3 more"),
    ]


def test_the_offset_of_utc_is_that_before_the_origin_and_steps_are_kept() -> None:
    course = built(
        (-2.0, ClockOffset(**HEAD, log_time_ns=0, wall_offset_ns=500_000_000, stepped=False)),
        (1.0, ClockOffset(**HEAD, log_time_ns=0, wall_offset_ns=9_000_000_000, stepped=True)),
    ).course(ORIGIN_NS, ORIGIN_NS + 2_000_000_000)
    assert course.utc_ns(1.0) == ORIGIN_NS + 1_500_000_000
    assert course.clock_steps_s == (1.0,)


@pytest.mark.parametrize(("reason", "said"), [("", ""), ("call at 10:05", " (call at 10:05)")])
def test_a_mark_is_stated_with_the_person_who_set_it_and_the_reason(reason: str, said: str) -> None:
    mark = Mark(**HEAD, id="m1", by="Ann", text="load set down", reason=reason)
    course = built((1.0, mark)).course(ORIGIN_NS, ORIGIN_NS + 10**9)
    assert [each.text for each in course.marks] == [f"Ann: load set down{said}"]


def test_alerts_and_marks_stand_among_the_events_however_many_others_there_are() -> None:
    builder = CourseBuilder(ORIGIN_NS)
    for second in range(300):
        line = Log(timestamp=FoxgloveTime(sec=0, nsec=0), level=2, message=f"line {second}", name="test")
        builder.add(ORIGIN_NS + second * 10**9, line)
    builder.add(ORIGIN_NS + 299 * 10**9, Mark(**HEAD, id="m1", by="Ann", text="load set down"))
    end_ns = ORIGIN_NS + 300 * 10**9
    window = IncidentWindow(ORIGIN_NS, end_ns, ORIGIN_NS, None, ())
    evidence = IncidentEvidence("yard", window, builder.course(ORIGIN_NS, end_ns), (), {}, None, {}, ())
    table = event_table(evidence)
    assert (len(table.rows), table.hidden) == (MAX_SHOWN_EVENTS, 302 - MAX_SHOWN_EVENTS)
    assert [row.kind for row in table.rows[-2:]] == ["mark", "recordings"]
    assert table.rows[-2].text == "Ann: load set down"


def active(rule: str, level: Level, incident: str | None) -> ActiveAlert:
    limit_deg = 6.0 if level == "trip" else 4.0
    return ActiveAlert(
        rule=rule,
        level=level,
        since_ns=0,
        limit_deg=limit_deg,
        clear_deg=3.0,
        incident=incident,
        text=f"{rule} {level}",
    )


def alert(event: AlertEventKind, rule: str | None, *standing: ActiveAlert, incident: str | None = None) -> Alert:
    return Alert(
        time_ns=0,
        clock="synchronised",
        sequence=0,
        level="normal",
        event=event,
        rule=rule,
        incident=incident,
        active=list(standing),
        text="",
    )


def test_changes_are_joined_by_their_id_and_numbered_in_order_of_time() -> None:
    swing, lean = active("swing", "trip", "b-1"), active("lean", "trip", "b-2")
    first, second = find_incidents(
        [
            (10, alert("raised", "swing", swing, incident="b-1")),
            (20, alert("raised", "lean", swing, lean, incident="b-2")),
            (30, alert("standing", None, swing, lean)),
            (40, alert("cleared", "swing", lean, incident="b-1")),
        ]
    )
    assert (first.number, first.id, first.rule, first.raised_ns, first.cleared_ns) == (1, "b-1", "swing", 10, 40)
    assert (second.number, second.id, second.rule, second.raised_ns, second.cleared_ns) == (2, "b-2", "lean", 20, None)


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


def test_recordings_that_end_with_the_word_of_a_stop_are_not_called_cut_off() -> None:
    builder = built((0.0, health(state="stopping")))
    assert builder.course(ORIGIN_NS, ORIGIN_NS + 1).end_cause.startswith("Nothing says that the gateway was stopped")
    assert builder.course(ORIGIN_NS, ORIGIN_NS + 1, was_stopped=True).end_cause == ""


def test_the_highest_change_is_the_first_one_at_the_highest_level() -> None:
    (found,) = find_incidents(
        [
            (10, alert("raised", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (20, alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")),
            (30, alert("changed", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (40, alert("cleared", "swing", incident="b-1")),
        ]
    )
    assert (found.level, found.highest.time_ns, found.highest.limit_deg) == ("trip", 20, 6.0)


def test_an_incident_that_is_unknown_in_the_recordings_is_not_normal() -> None:
    (found,) = find_incidents(
        [
            (10, alert("acknowledged", "swing", incident="b-1")),
            (20, alert("changed", "swing", active("swing", "unknown", "b-1"), incident="b-1")),
            (30, alert("cleared", "swing", incident="b-1")),
        ]
    )
    assert (found.level, found.highest.time_ns) == ("unknown", 20)


def test_an_alert_that_stands_when_the_recordings_begin_is_an_incident() -> None:
    standing = active("swing", "trip", "b-7")
    (found,) = find_incidents(
        [(10, alert("standing", None, standing)), (20, alert("cleared", "swing", incident="b-7"))]
    )
    assert [change.event for change in found.changes] == [STANDING, "cleared"]
    assert (found.level, found.highest.limit_deg) == ("trip", 6.0)


def test_an_incident_without_an_end_stood_until_its_last_message() -> None:
    standing = active("swing", "trip", "b-1")
    first, second = find_incidents(
        [
            (10, alert("raised", "swing", standing, incident="b-1")),
            (20, alert("standing", None, standing)),
            (99, alert("raised", "swing", active("swing", "trip", "c-1"), incident="c-1")),  # after a restart
        ]
    )
    assert (first.cleared_ns, first.last_ns) == (None, 20)
    assert second.raised_ns == 99


def test_changes_without_an_incident_are_none() -> None:
    assert find_incidents([(10, alert("changed", "swing")), (20, alert("standing", None))]) == []


def test_old_recordings_without_ids_are_joined_by_rule() -> None:
    trip = active("swing", "trip", None)
    first, second = find_incidents(
        [
            (10, alert("raised", "swing", trip)),
            (20, alert("cleared", "swing")),
            (30, alert("changed", "swing")),
            (40, alert("raised", "swing", trip)),
        ]
    )
    assert (first.raised_ns, first.cleared_ns) == (10, 20)
    assert (second.raised_ns, second.cleared_ns) == (40, None)


def test_an_acknowledgement_after_the_end_changes_neither_the_end_nor_the_level() -> None:
    known = replace(alert("acknowledged", "swing", incident="b-1"), acknowledged_by="ann", reason="load set down")
    found, _ = find_incidents(
        [
            (10, alert("raised", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (40, alert("cleared", "swing", incident="b-1")),
            (8000, alert("raised", "swing", active("swing", "trip", "b-2"), incident="b-2")),
            (9000, replace(known, active=[active("swing", "trip", "b-2")])),
        ]
    )
    assert (found.cleared_ns, found.last_ns, found.level) == (40, 40, "warn")
    assert found.acknowledgement is not None
    assert (found.acknowledgement.time_ns, found.acknowledgement.acknowledged_by) == (9000, "ann")


@pytest.mark.parametrize(
    ("span_s", "labels"),
    [
        (90.0, ["00:00:15", "00:00:30", "00:00:45", "00:01:00", "00:01:15", "00:01:30"]),
        (3600.0, ["00:10:00", "00:20:00", "00:30:00", "00:40:00", "00:50:00"]),
        (3.0, ["00:00:07.5", "00:00:08.0", "00:00:08.5", "00:00:09.0", "00:00:09.5", "00:00:10.0"]),
    ],
)
def test_ticks_stand_at_round_times(span_s: float, labels: list[str]) -> None:
    clock = ReportClock(CourseBuilder(BEGIN_NS).course(BEGIN_NS, BEGIN_NS + round(span_s * 1e9)))
    ticks_s = tick_times(clock, 0.0, span_s)
    assert [tick_label(clock, tick_s, span_s) for tick_s in ticks_s] == labels
    assert np.ptp(np.diff(ticks_s)) < 1e-6


def test_a_certificate_is_made_from_its_record_and_not_taken_from_the_recording() -> None:
    record = sealed({**make_parent().model_dump(mode="json"), "by": HOSTILE.decode()})
    name = f"calibration-{record.id}"
    made = make_certificates({f"{name}.json": record.model_dump_json().encode(), f"{name}.html": HOSTILE})
    assert list(made) == [f"{name}.html"]
    assert b"Calibration certificate" in made[f"{name}.html"]
    assert HOSTILE not in made[f"{name}.html"]


def test_a_certificate_without_a_valid_record_is_left_out() -> None:
    assert (
        make_certificates({"calibration-a.html": HOSTILE, "calibration-a.json": b"{}", "calibration-b.html": HOSTILE})
        == {}
    )


@pytest.mark.parametrize(
    ("kind", "clock", "source"),
    [
        ("adxl355", "synchronised", ""),
        ("simulated", "synchronised", "SIMULATION"),
        ("replay", "synchronised", "REPLAY"),
        ("adxl355", "replayed", "REPLAY"),
    ],
)
def test_the_source_is_stated_where_no_sensor_took_the_samples(kind: str, clock: ClockQuality, source: str) -> None:
    offset = ClockOffset(**{**HEAD, "clock": clock}, log_time_ns=0, wall_offset_ns=0, stepped=False)
    course = built((0.0, offset), (1.0, health(device_kind=kind))).course(ORIGIN_NS, ORIGIN_NS + 2 * 10**9)
    assert course.source == source


def test_the_drawn_limit_is_the_one_in_force_at_each_time() -> None:
    builder = CourseBuilder(ORIGIN_NS)
    for time_s, boot, trip_deg in ((0, "a", 6.0), (10, "a", 6.0), (20, "b", 5.0), (30, "c", 5.0)):
        toml = f"[alerts]\nwarn_deg = 4.0\ntrip_deg = {trip_deg}\nclear_deg = 3.0\n# {boot}\n"
        builder.add_run(ORIGIN_NS + time_s * 10**9, boot, toml)
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 40 * 10**9)
    (incident,) = find_incidents(
        [
            (1, alert("raised", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (2, alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")),
        ]
    )
    assert levels_in_force(course, incident) == {
        "warn": [(0.0, 40.0, 4.0)],
        "trip": [(0.0, 20.0, 6.0), (20.0, 40.0, 5.0)],
        "clears below": [(0.0, 40.0, 3.0)],
    }
    (change,) = course.limit_changes
    assert (change.words, change.audit) == ("the trip limit of the swing was changed from 6.0° to 5.0°", None)


@pytest.mark.parametrize(
    ("said", "end"),
    [
        ({"reason": "sling", "proposed_reason": "test"}, ", with the words: sling"),
        ({"reason": "", "proposed_reason": "new rope"}, ", with the words of the proposal: new rope"),
        ({"reason": ""}, ""),
    ],
)
def test_the_words_of_a_proposal_are_not_lost_where_who_applied_it_said_none(said: dict[str, str], end: str) -> None:
    entry = AuditEntry(0.0, {"event": "applied", "by": "ann", **said})
    assert entry.words == f"Settings changed by ann{end}"


def test_no_state_outlasts_the_run_that_stated_it() -> None:
    builder = CourseBuilder(ORIGIN_NS)
    for time_s, boot in ((0, "a"), (3, "a"), (10, "b"), (12, "b")):
        builder.add_run(ORIGIN_NS + time_s * 10**9, boot, None)
    builder.add(ORIGIN_NS, health())
    builder.add(ORIGIN_NS + 10 * 10**9, health())
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 13 * 10**9)
    assert course.health.spans(course.end_s) == [(0.0, 3.0, "running"), (10.0, 13.0, "running")]
    (restart,) = course.restarts
    assert (restart.stopped_s, restart.started_s, restart.is_announced) == (3.0, 10.0, False)


@pytest.mark.parametrize(("time_s", "text"), [(0.04, "00:00:00.0"), (0.05, "00:00:00.1"), (59.96, "00:01:00.0")])
def test_times_are_rounded(time_s: float, text: str) -> None:
    clock = ReportClock(CourseBuilder(ORIGIN_NS).course(ORIGIN_NS, ORIGIN_NS + 10**9))
    assert clock.time(time_s) == text
