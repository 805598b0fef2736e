"""The course of an incident from single messages: gaps, recalibrations, faults and steps of the clock."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import correction_for
from gateway.incident.course import CourseBuilder
from gateway.incident.evidence import IncidentEvidence
from gateway.incident.incident_selection import IncidentWindow
from gateway.incident.incident_summary import MAX_SHOWN_EVENTS, event_table
from gateway.messages import NO_SESSION, Calibration, ClockOffset, FoxgloveTime, Health, Log, Mark
from gateway.recording.reading.recording_file import SegmentIndex
from gateway.recording.reading.sample_calibration import CalibratedBlock

ORIGIN_NS = 1_767_225_600_000_000_000
HEAD: dict[str, Any] = {"time_ns": ORIGIN_NS, "clock": "synchronised", "sequence": 0}


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
    return CalibratedBlock(SegmentIndex(Path("one.mcap"), 0), samples, np.full((10, 3), first_s), correction, 0)


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
        (1.0, "Recalibration collecting by Ann. Turn the housing."),
        (3.0, "Recalibration committed by Ann. Done."),
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


def test_a_mark_is_stated_with_the_person_who_set_it() -> None:
    course = built((1.0, Mark(**HEAD, id="m1", by="Ann", text="load set down"))).course(ORIGIN_NS, ORIGIN_NS + 10**9)
    assert [each.text for each in course.marks] == ["Ann: load set down"]


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
    assert (len(table.rows), table.hidden) == (MAX_SHOWN_EVENTS, 301 - MAX_SHOWN_EVENTS)
    assert (table.rows[-1].kind, table.rows[-1].text) == ("mark", "Ann: load set down.")
