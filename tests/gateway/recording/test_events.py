"""Segments around an alert are the last that the quota takes."""

from pathlib import Path

import pytest

from gateway.recording.events import AlertEventIndex
from gateway.recording.retention import Retention, SegmentNames, marker_path

NAMES = SegmentNames("yard", "crane-2", "hook")
SECOND_NS = 1_000_000_000
START_NS = 1_767_225_600 * SECOND_NS


@pytest.fixture
def segments(tmp_path: Path) -> list[Path]:
    """Six segments of a minute and 1 kB each, with an alert half a minute into the third."""
    marks = AlertEventIndex(pre_event_s=40.0, post_event_s=40.0)
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
