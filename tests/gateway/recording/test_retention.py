"""The quota takes the oldest segments first, and those around an alert last."""

from pathlib import Path
from typing import Any

import pytest

from gateway.messages import Alert, Calibration, Health, Mark
from gateway.recording.segments.events import (
    TRIMMED_LINE,
    EventDetector,
    EventIndex,
    EventInterval,
    append_event_interval,
    marker_path,
    note_trimmed,
    read_event_intervals,
)
from gateway.recording.segments.retention import DiskSpace, Retention, SegmentNames
from tests.clocks import START_NS
from tests.gateway.recording.conftest import SECOND_NS

NAMES = SegmentNames("yard", "crane-2", "hook")
HEAD: dict[str, Any] = {"time_ns": START_NS, "clock": "synchronised", "sequence": 0, "calibration_id": "c-1"}


def make(folder: Path, *utc: str) -> list[Path]:
    paths = [folder / f"yard-crane-2-hook-{entry}.mcap" for entry in utc]
    for path in paths:
        path.write_bytes(bytes(1000))
    return paths


def test_only_the_oldest_segments_are_deleted(tmp_path: Path) -> None:
    last, first, copy, middle = make(
        tmp_path, "20260103T000000Z", "20260101T000000Z", "20260101T000000Z-2", "20260102T000000Z"
    )
    retention = Retention(NAMES, tmp_path, quota_mb=0.0035)
    retention.rescan()
    assert retention.enforce(open_bytes=0) == [first]
    assert retention.enforce(open_bytes=1400) == [copy]
    assert retention.enforce(open_bytes=1500) == []
    assert sorted(tmp_path.iterdir()) == [middle, last]


def test_a_disk_that_is_smaller_than_the_quota_is_a_ring(tmp_path: Path) -> None:
    """Five segments of 1 kB on a disk with 100 bytes left: the oldest makes room; one with an event makes room later."""
    event, second, *others = make(tmp_path, *(f"2026010{day}T000000Z" for day in range(1, 6)))
    marker_path(event).write_text("")
    retention = Retention(NAMES, tmp_path, quota_mb=1.0, space=lambda _: DiskSpace(5100.0, 100.0))
    retention.rescan()
    assert retention.enforce(open_bytes=0) == [second]
    assert event.exists()
    assert all(path.exists() for path in others)


def test_segments_with_events_do_not_make_room_for_another_programs_files(tmp_path: Path) -> None:
    paths = make(tmp_path, "20260101T000000Z", "20260102T000000Z")
    for path in paths:
        marker_path(path).write_text("")
    retention = Retention(NAMES, tmp_path, quota_mb=1.0, space=lambda _: DiskSpace(30_000.0, 0.0))
    retention.rescan()
    assert retention.enforce(open_bytes=0) == []
    assert retention.take_segments_to_trim() == []


def test_recording_goes_on_where_every_segment_has_events_and_the_disk_is_smaller_than_the_quota(
    tmp_path: Path,
) -> None:
    paths = make(tmp_path, *(f"2026010{day}T000000Z" for day in range(1, 6)))
    for path in paths:
        marker_path(path).write_text("")
    retention = Retention(NAMES, tmp_path, quota_mb=1.0, space=lambda _: DiskSpace(5000.0, 0.0), keep_events_days=365.0)
    retention.rescan()
    assert retention.enforce(open_bytes=0) == []
    assert retention.take_segments_to_trim() == [paths[0]]
    marker_path(paths[0]).write_bytes(TRIMMED_LINE)
    for path in paths[1:]:  # trimming does not help
        retention.rescan()
        retention.enforce(open_bytes=0)
        marker_path(path).write_bytes(TRIMMED_LINE)
    retention.rescan()
    assert retention.enforce(open_bytes=0) == [paths[0]]


def test_no_quota_deletes_an_event_before_its_time(tmp_path: Path) -> None:
    old, first, second, plain = make(
        tmp_path, "20260101T000000Z", "20260103T000001Z", "20260109T000000Z", "20260110T000000Z"
    )
    marker_path(old).write_bytes(TRIMMED_LINE)
    marker_path(first).write_bytes(b"")
    marker_path(second).write_bytes(TRIMMED_LINE)
    space = DiskSpace(1e6, 1e6)
    retention = Retention(NAMES, tmp_path, quota_mb=0.000001, space=lambda _: space, keep_events_days=7.0)
    retention.rescan()
    assert retention.enforce(open_bytes=0) == [plain]
    assert retention.take_segments_to_trim() == [first]
    marker_path(first).write_bytes(TRIMMED_LINE)
    retention.rescan()
    assert retention.enforce(open_bytes=0) == [old]
    assert retention.enforce(open_bytes=0) == []
    assert first.exists()
    assert second.exists()


def test_a_segment_that_cannot_be_deleted_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path, "20260101T000000Z", "20260102T000000Z")

    def refused(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(1, "Operation not permitted", str(path))

    monkeypatch.setattr(Path, "unlink", refused)
    retention = Retention(NAMES, tmp_path, quota_mb=0.0001)
    retention.rescan()
    assert [retention.enforce(open_bytes=0) for _ in range(5)] == [[]] * 5
    assert retention.undeletable == 2


def test_the_reason_is_known_before_a_segment_is_deleted(tmp_path: Path) -> None:
    paths = make(tmp_path, *(f"2026010{day}T000000Z" for day in range(1, 6)))
    noted: list[tuple[Path, str]] = []

    def note(path: Path, reason: str) -> None:
        assert path.exists()
        noted.append((path, reason))

    for quota_mb in (0.0045, 1.0):  # more than the quota; less than it, on a disk that is full
        retention = Retention(NAMES, tmp_path, quota_mb, note, space=lambda _: DiskSpace(5100.0, 100.0))
        retention.rescan()
        retention.enforce(open_bytes=0)
    assert noted == [(paths[0], "quota"), (paths[1], "disk")]


def test_a_segment_that_was_deleted_already_is_no_error(tmp_path: Path) -> None:
    (gone,) = make(tmp_path, "20260101T000000Z")
    retention = Retention(NAMES, tmp_path, quota_mb=0.0001)
    retention.rescan()
    gone.unlink()
    assert retention.enforce(open_bytes=0) == [gone]


@pytest.mark.parametrize(
    "name",
    [
        "yard-crane-2-hook-20260101T000000Z.mcap.part",
        "yard-crane-2-hook-20260101T000000Z-x.mcap",
        "yard-crane-2-hook-2-20260101T000000Z.mcap",
        "xyard-crane-2-hook-20260101T000000Z.mcap",
        "yard-crane-2-hook-20260101.mcap",
    ],
)
def test_files_with_other_names_are_not_deleted(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(bytes(1000))
    assert NAMES.list_segments(tmp_path) == []


def test_dots_in_names_are_taken_literally(tmp_path: Path) -> None:
    (tmp_path / "yardXa-c-s-20260101T000000Z.mcap").write_bytes(b"")
    assert SegmentNames("yard.a", "c", "s").list_segments(tmp_path) == []


def test_a_used_name_gets_a_number(tmp_path: Path) -> None:
    start_ns = 1_767_225_600_000_000_000
    taken = []
    for _ in range(3):
        taken.append(NAMES.unused_path(tmp_path, start_ns))
        taken[-1].touch()
    stem = "yard-crane-2-hook-20260101T000000Z"
    assert [path.name for path in taken] == [f"{stem}.mcap", f"{stem}-1.mcap", f"{stem}-2.mcap"]
    assert [segment.path for segment in NAMES.list_segments(tmp_path)] == taken


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
