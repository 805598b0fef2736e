"""Segments around an alert are the last that the quota takes."""

from pathlib import Path
from typing import Any

import pytest

from gateway.messages import Alert, Calibration, Health, Mark
from gateway.recording.events import EventDetector, EventIndex
from gateway.recording.retention import Retention, SegmentNames, marker_path

NAMES = SegmentNames("yard", "crane-2", "hook")
SECOND_NS = 1_000_000_000
START_NS = 1_767_225_600 * SECOND_NS


@pytest.fixture
def segments(tmp_path: Path) -> list[Path]:
    """Six segments of a minute and 1 kB each, with an alert half a minute into the third."""
    marks = EventIndex(pre_event_s=40.0, post_event_s=40.0)
    paths = []
    for minute in range(6):
        begins_ns = START_NS + minute * 60 * SECOND_NS
        path = NAMES.unused_path(tmp_path, begins_ns)
        path.write_bytes(bytes(1000))
        marks.begin_segment(path, begins_ns)
        if minute == 2:
            marks.add_event(begins_ns + 30 * SECOND_NS)
        paths.append(path)
    return paths


def test_segments_near_an_event_are_marked(segments: list[Path]) -> None:
    assert [marker_path(path).exists() for path in segments] == [False, True, True, True, False, False]


def test_segments_without_events_are_deleted_first(tmp_path: Path, segments: list[Path]) -> None:
    retention = Retention(NAMES, tmp_path, quota_mb=0.0025)  # room for two and a half
    retention.rescan()
    assert retention.enforce(0) == [segments[i] for i in (0, 4, 5, 1)]
    assert sorted(tmp_path.iterdir()) == sorted([*segments[2:4], *(marker_path(path) for path in segments[2:4])])


HEAD: dict[str, Any] = {"time_ns": START_NS, "clock": "synchronised", "sequence": 0, "calibration_id": "c-1"}


def alert(event: Any) -> Alert:
    return Alert(**HEAD, level="trip", event=event, rule="swing", active=[], text="")


def calibration(name: str) -> Calibration:
    return Calibration(
        **{**HEAD, "calibration_id": name}, status="calibrated", device_id="d", record={}, in_force={}, text=""
    )


def health(faults: int) -> Health:
    return Health(
        **HEAD,
        state="running",
        device_kind="adxl355",
        boot_id="b",
        software="s",
        uptime_s=1.0,
        samples=1,
        lost=0,
        invalid=0,
        faults={"overrun": faults},
        dropped={},
    )


def test_alerts_changes_of_the_calibration_new_faults_and_marks_are_events() -> None:
    detector = EventDetector()
    course = [
        (alert("standing"), False),
        (alert("raised"), True),
        (alert("cleared"), False),
        (calibration("c-1"), False),
        (calibration("c-1"), False),
        (calibration("c-2"), True),
        (health(3), False),
        (health(3), False),
        (health(4), True),
        (Mark(**HEAD, id="cli-12345678", by="ann", text="here"), True),
    ]
    assert [detector.is_event(message) for message, _ in course] == [expected for _, expected in course]
