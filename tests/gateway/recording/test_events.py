"""Segments around an alert are the last that the quota takes."""

from pathlib import Path
from typing import Any

import pytest

from gateway.messages import Alert, Calibration, Health, Mark
from gateway.recording.segments.events import (
    EventDetector,
    EventIndex,
    EventInterval,
    append_event_interval,
    marker_path,
    note_trimmed,
    read_event_intervals,
)
from gateway.recording.segments.retention import Retention, SegmentNames

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


def test_segments_without_events_are_deleted_first_then_those_with_events_are_trimmed(
    tmp_path: Path, segments: list[Path]
) -> None:
    retention = Retention(NAMES, tmp_path, quota_mb=0.0025)  # room for two and a half
    retention.rescan()
    assert retention.enforce(0) == [segments[i] for i in (0, 4, 5)]
    assert retention.take_segments_to_trim() == [segments[1]]
    assert retention.take_segments_to_trim() == []
    assert sorted(tmp_path.iterdir()) == sorted([*segments[1:4], *(marker_path(path) for path in segments[1:4])])


def test_a_segment_that_could_not_be_trimmed_is_deleted_in_its_turn(tmp_path: Path, segments: list[Path]) -> None:
    retention = Retention(NAMES, tmp_path, quota_mb=0.0025)
    retention.rescan()
    retention.enforce(0)
    retention.rescan()
    assert retention.enforce(0) == [segments[1]]


def test_trimmed_segments_are_deleted_last(tmp_path: Path, segments: list[Path]) -> None:
    note_trimmed(segments[1])
    retention = Retention(NAMES, tmp_path, quota_mb=0.0015)
    retention.rescan()
    assert [segment.path for segment in NAMES.list_segments(tmp_path)] == [segments[i] for i in (0, 4, 5, 2, 3, 1)]


def test_the_marker_states_the_time_around_its_events(segments: list[Path]) -> None:
    event_ns = START_NS + 150 * SECOND_NS
    stretch = EventInterval(event_ns - 40 * SECOND_NS, event_ns + 40 * SECOND_NS)
    assert [read_event_intervals(path) for path in segments[1:4]] == [[stretch]] * 3


def test_stretches_that_overlap_are_one(segments: list[Path]) -> None:
    for from_s, to_s in ((5, 9), (1, 3), (2, 6)):
        append_event_interval(segments[0], EventInterval(from_s, to_s))
    assert read_event_intervals(segments[0]) == [EventInterval(1, 9)]


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
