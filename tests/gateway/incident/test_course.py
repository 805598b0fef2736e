"""The course of an incident, its events and its evidence, from single messages and records."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import correction_for
from gateway.incident.course_builder import CourseBuilder
from gateway.incident.event_table import MAX_SHOWN_EVENTS, event_table
from gateway.incident.evidence import IncidentEvidence, make_certificates
from gateway.incident.incident_report import configuration_in_force
from gateway.incident.incident_selection import IncidentWindow, find_incidents
from gateway.incident.incident_summary import which_settings_were_changed
from gateway.incident.setting_changes import AuditEntry
from gateway.incident.timeline_figure import ReportClock, levels_in_force, tick_label, tick_times
from gateway.messages import (
    ClockOffset,
    ClockQuality,
    FoxgloveTime,
    Log,
    Mark,
)
from gateway.recording.format.content import ORIGIN, SEGMENT
from gateway.recording.reading.recording_file import SegmentIndex
from gateway.recording.reading.sample_calibration import CalibratedBlock
from tests.gateway.calibration.test_acceptance import make_parent
from tests.gateway.certificate.conftest import sealed
from tests.gateway.incident.stated import HEAD, ORIGIN_NS, active, alert, built, calibration, health
from tests.values import present

BEGIN_NS = 1_767_225_607_130_000_123
"""2026-01-01 00:00:07.130 UTC."""
HOSTILE = b"<script>alert(1)</script>"


def block(first_s: float, lost: int = 0) -> CalibratedBlock:
    """Ten samples at 10 Hz."""
    time_ns = ORIGIN_NS + np.rint((first_s + np.arange(10) / 10) * 1e9).astype(np.int64)
    samples = SampleBlock(time_ns=time_ns, raw=np.zeros((10, 3), dtype=np.int32), lost=lost)
    info = DeviceInfo(kind="adxl355", device_id="part-7", unit="counts", odr_hz=10.0, units_per_g=256e3)
    correction = correction_for(info, ((0, 1), (1, 1), (2, 1)), None)
    return CalibratedBlock(SegmentIndex(Path("one.mcap"), 0), samples, np.full((10, 3), first_s), correction, 0, 0)


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


@pytest.mark.parametrize(("numbers", "cause"), [((3, 4), "gateway restarted"), ((3, 5), "not in these files")])
def test_a_segment_that_is_missing_between_two_runs_is_no_restart(numbers: tuple[int, int], cause: str) -> None:
    builder = CourseBuilder(ORIGIN_NS)
    for first_s, boot, number in zip((0.0, 5.0), ("a", "b"), numbers, strict=True):
        builder.add_run(ORIGIN_NS + round(first_s * 1e9), boot, None)
        segment = SegmentIndex(Path(boot), 0, metadata={ORIGIN: {SEGMENT: str(number)}})
        builder.add_block(replace(block(first_s), segment=segment))
    (gap,) = (each for each in builder.course(ORIGIN_NS, ORIGIN_NS + 5_900_000_000).samples.gaps)
    assert gap.cause == cause


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
    evidence = IncidentEvidence("yard", window, builder.course(ORIGIN_NS, end_ns), (), {}, {}, ())
    table = event_table(evidence)
    assert (len(table.rows), table.hidden) == (MAX_SHOWN_EVENTS, 302 - MAX_SHOWN_EVENTS)
    assert [row.kind for row in table.rows[-2:]] == ["mark", "recordings"]
    assert table.rows[-2].text == "Ann: load set down"


def test_recordings_that_end_with_the_word_of_a_stop_are_not_called_cut_off() -> None:
    builder = built((0.0, health(state="stopping")))
    assert builder.course(ORIGIN_NS, ORIGIN_NS + 1).end_cause.startswith("Nothing says that the gateway was stopped")
    assert builder.course(ORIGIN_NS, ORIGIN_NS + 1, end_cause="").end_cause == ""


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
    made = make_certificates({f"{name}.json": record.model_dump_json().encode(), f"{name}.html": HOSTILE}, {record.id})
    assert list(made) == [f"{name}.html"]
    assert b"Calibration certificate" in made[f"{name}.html"]
    assert HOSTILE not in made[f"{name}.html"]


def test_a_certificate_compares_its_record_with_a_parent_that_is_in_the_recordings_too() -> None:
    parent = make_parent()
    child = sealed({**parent.model_dump(mode="json"), "id": "child", "parent": parent.id})
    files = {f"calibration-{each.id}": each.model_dump_json().encode() for each in (child, parent)}
    given = {f"{name}.{ending}": each for name, each in files.items() for ending in ("json", "html")}
    made = make_certificates(given, {"child"})
    assert list(made) == ["calibration-child.html"]
    assert f"Change since the parent record {parent.id}".encode() in made["calibration-child.html"]
    assert b"no comparison is made" not in made["calibration-child.html"]


def test_a_certificate_without_a_valid_record_is_left_out() -> None:
    damaged = {"calibration-a.html": HOSTILE, "calibration-a.json": b"{}", "calibration-b.html": HOSTILE}
    assert make_certificates(damaged, {"a", "b"}) == {}


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
    (change,) = course.setting_changes
    assert (change.words, change.audit) == ("the trip limit of the swing was changed from 6.0° to 5.0°", None)


def test_a_rope_length_that_was_changed_before_an_alert_is_said_and_the_configuration_of_the_alert_is_printed() -> None:
    builder, other = CourseBuilder(ORIGIN_NS), 22.0
    for time_s, length_m in ((0, 22.0), (8, 12.0), (30, other)):
        builder.add_run(ORIGIN_NS + time_s * 10**9, "a", f"[rope]\nlength_m = {length_m}\n[page]\nport = {time_s}\n")
    audit = {"event": "applied", "by": "ann", "changes": ["rope.length_m: 22.0 -> 12.0"], "reason": "other block"}
    builder.add(
        ORIGIN_NS + 7 * 10**9,
        Log(timestamp=FoxgloveTime(sec=0, nsec=0), level=2, name="test", message=f"audit {json.dumps(audit)}"),
    )
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 40 * 10**9)
    raised = alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")
    (incident,) = find_incidents([(ORIGIN_NS + 10 * 10**9, raised)])
    (told,) = which_settings_were_changed(course, ReportClock(course), incident)
    assert told.startswith(
        "Before it, the length of the rope was changed from 22.0 m to 12.0 m by ann at 00:00:07.0 UTC, with the words: other"
    )
    assert told.endswith("2.0 s before the trip.")
    toml, when = configuration_in_force(course, incident)
    assert "length_m = 12.0" in toml
    assert when.startswith("In force when the alert was at its highest level, from ")
    assert configuration_in_force(course, None)[0].startswith(f"[rope]\nlength_m = {other}")


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


def test_only_the_calibration_in_force_at_the_begin_and_later_ones_are_of_a_report() -> None:
    """Messages of the 15 s before a report state what is in force at its begin; the one before that was not."""
    stated = ((-12.0, calibration(0.5)), (-5.0, calibration(0.25)), (3.0, calibration(0.75)))
    found = built(*stated).course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000)
    assert [time_s for time_s, _ in found.calibrations] == [-5.0, 3.0]


def test_the_health_of_a_report_is_that_of_the_run_in_which_its_incident_lies() -> None:
    stated = ((-5.0, health(boot_id="one")), (4.0, health(boot_id="one", samples=9)), (8.0, health(boot_id="two")))
    found = present(built(*stated).course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000).last_health)
    assert (found.boot_id, found.samples) == ("one", 9)
