"""Segments of gateways as timelines, by their indexes, and their intervals, in seconds from the start and in UTC."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from devices.errors import RecordingError
from gateway import messages
from gateway.errors import InputError
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import RecordingHeader
from gateway.recording.reading.interval import (
    RecordingExtent,
    RecordingInterval,
    iso_utc,
    parse_duration,
    parse_recording_time,
)
from gateway.recording.reading.recording_file import EVERYTHING, Selection, read_index
from gateway.recording.reading.samples import read_samples
from gateway.recording.reading.timeline import Timeline, open_timeline, open_timelines, summarise_segment
from gateway.recording.segments.copying import recover
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import DEVICE, EVERY_MESSAGE, HEADER, Record

BLOCK_NS = 32_000_000
"""A block of 32 samples at 1 kHz."""
WriteRun = Callable[..., list[Path]]


@pytest.fixture
def write_run(tmp_path: Path) -> WriteRun:
    """Write blocks of these numbers in segments of 2 s, with a calibration, a clock each second and an alert."""

    def write(numbers: range = range(200), header: RecordingHeader = HEADER, folder: Path = tmp_path) -> list[Path]:
        recorder = Recorder(folder, header, segment_s=2.0, fsync_s=0.1, quota_mb=100.0)
        before = set(folder.glob("*.mcap"))
        begin_ns = START_NS + numbers.start * BLOCK_NS
        recorder.set_device(DEVICE, begin_ns)
        recorder.start(begin_ns)
        calibration, clock, alert = (EVERY_MESSAGE[name] for name in ("calibration", "clock", "alert"))
        assert isinstance(clock, messages.ClockOffset)
        recorder.write(encode_message("calibration", calibration, begin_ns))
        for number in numbers:
            block = make_samples(number, period_ns=1e6)
            if number % 31 == 0:
                recorder.write(encode_message("clock", replace(clock, sequence=number), block.time_ns))
            recorder.write(encode_message("samples", block, block.time_ns))
            if number == numbers.start + 50:
                recorder.write(encode_message("alert", alert, block.time_ns))
            recorder.tick(block.time_ns)
        recorder.close()
        return sorted(set(folder.glob("*.mcap")) - before)

    return write


def times_ns(timeline: Timeline, selection: Selection = EVERYTHING) -> Iterator[int]:
    for message in timeline.messages(selection):
        yield message.recorded.log_time_ns


@pytest.mark.slow
def test_index_of_a_closed_segment_equals_what_its_messages_say(write_run: WriteRun) -> None:
    for path in write_run():
        index = read_index(path)
        read = summarise_segment(open_timeline([path]).segments[0])
        assert index.is_closed
        assert index.summary == read.summary
        assert read.summary is not None
        assert (index.from_ns, index.to_ns) == (read.summary.from_ns, read.summary.to_ns)
        assert index.metadata["plumbline"]["crane"] == "crane-2"


@pytest.mark.slow
def test_index_of_an_incomplete_segment_has_its_times_and_metadata_up_to_the_end(write_run: WriteRun) -> None:
    path = write_run()[0]
    whole = read_index(path)
    os.truncate(path, path.stat().st_size // 2)
    index = read_index(path)
    summary = summarise_segment(open_timeline([path]).segments[0]).summary
    assert summary is not None
    assert (index.is_closed, index.summary) == (False, None)
    assert (index.from_ns, index.to_ns) == (summary.from_ns, summary.to_ns)
    assert (index.from_ns, index.metadata) == (whole.from_ns, whole.metadata)


@pytest.mark.slow
@pytest.mark.parametrize("place", [-60, -400, -1000])
def test_nothing_is_taken_from_the_unsigned_section_at_the_end(write_run: WriteRun, place: int) -> None:
    path = write_run()[0]
    whole = read_index(path)
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    assert replace(read_index(path), is_closed=whole.is_closed) == whole


@pytest.mark.slow
def test_summary_of_another_file_is_not_believed(write_run: WriteRun, tmp_path: Path) -> None:
    first, second, *_ = write_run()
    mixed = bytearray(first.read_bytes())
    count = f'"count":{read_index(first).summary.topics["/samples"].count}'.encode()  # type: ignore[union-attr]
    place = mixed.rindex(count)
    mixed[place : place + len(count)] = count.replace(count[-1:], b"9" if count[-1:] != b"9" else b"8")
    (tmp_path / "mixed.mcap").write_bytes(mixed)
    assert read_index(tmp_path / "mixed.mcap").summary is None
    assert read_index(second).summary is not None


@pytest.mark.slow
def test_segments_are_one_timeline_in_which_nothing_occurs_twice(write_run: WriteRun, tmp_path: Path) -> None:
    paths = write_run()
    assert len(paths) == 4
    timeline = open_timeline([tmp_path])
    assert [segment.path for segment in timeline.segments] == paths
    topics = [message.recorded.topic for message in timeline.messages()]
    assert topics.count("/samples") == 200
    assert topics.count("/clock") == 7
    assert topics.count("/calibration") == 1
    shuffled = open_timeline([paths[2], paths[0], paths[3], paths[1]])
    assert list(times_ns(shuffled)) == list(times_ns(timeline))


@pytest.mark.slow
def test_selection_reads_the_interval_and_the_topics_that_are_wanted(write_run: WriteRun) -> None:
    timeline = open_timeline(write_run())
    everything = [(message.recorded.topic, message.recorded.log_time_ns) for message in timeline.messages()]
    begin_ns, end_ns = START_NS + 1_900_000_000, START_NS + 4_100_000_000
    wanted = Selection(begin_ns, end_ns, frozenset({"/samples", "/alert"}))
    found = [(message.recorded.topic, message.recorded.log_time_ns) for message in timeline.messages(wanted)]
    assert found == [
        (topic, time_ns)
        for topic, time_ns in everything
        if begin_ns <= time_ns < end_ns and topic in wanted.topics  # type: ignore[operator]
    ]
    assert len(found) > 60


@pytest.mark.slow
def test_interval_counts_from_the_first_sample(write_run: WriteRun) -> None:
    timeline = open_timeline(write_run())
    span = timeline.span()
    assert (span.first_ns, span.last_ns) == (START_NS, START_NS + 200 * BLOCK_NS - 1_000_000)
    interval = RecordingInterval(parse_recording_time("1.5"), parse_recording_time("2"))
    assert timeline.select(interval) == Selection(START_NS + 1_500_000_000, START_NS + 2_000_000_000)
    last = timeline.select(RecordingInterval(last_s=1.0), ["/samples"])
    assert last == Selection(span.last_ns - 1_000_000_000, None, frozenset({"/samples"}))


@pytest.mark.slow
def test_progress_reaches_the_end_and_never_goes_back(write_run: WriteRun) -> None:
    shares: list[float] = []
    for _ in open_timeline(write_run()).messages(report=shares.append):
        pass
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_gateways_are_told_apart(write_run: WriteRun, tmp_path: Path) -> None:
    write_run(range(10))
    other = write_run(range(10, 20), header=replace(HEADER, crane="crane-3"))
    assert [timeline.gateway for timeline in open_timelines([tmp_path])] == ["yard/crane-2/hook", "yard/crane-3/hook"]
    with pytest.raises(
        RecordingError, match=rf"{other[0].name}: is of gateway yard/crane-3/hook, .* give the files of one"
    ):
        open_timeline([tmp_path])


def test_files_of_a_folder_that_cannot_be_read_are_left_out_with_a_remark(write_run: WriteRun, tmp_path: Path) -> None:
    paths = write_run(range(10))
    (tmp_path / "notes.mcap").write_text("no recording")
    timeline = open_timeline([tmp_path])
    assert [segment.path for segment in timeline.segments] == paths
    (remark,) = timeline.remarks
    assert remark.startswith(f"{tmp_path / 'notes.mcap'}: is not an MCAP file")
    with pytest.raises(RecordingError, match=r"notes\.mcap: is not an MCAP file"):
        open_timeline([*paths, tmp_path / "notes.mcap"])


def test_recovered_copy_takes_the_place_of_its_source(write_run: WriteRun, tmp_path: Path) -> None:
    path = write_run(range(60))[0]
    os.truncate(path, path.stat().st_size - 3000)
    copy = tmp_path / "copy.mcap"
    recover(path, copy)
    timeline = open_timeline([tmp_path])
    assert [segment.path for segment in timeline.segments] == [copy]
    assert timeline.remarks == (f"{path.name}: left out, because copy.mcap has the same messages",)


@pytest.mark.parametrize("name", ["Copy of one.mcap", "zone.mcap"])
@pytest.mark.parametrize("signed", [True, False])
def test_a_second_copy_of_a_file_is_left_out_with_a_remark(record: Record, name: str, *, signed: bool) -> None:
    """The one stays that has the name that the gateway gave it, wherever it is in the order of names."""
    paths = record(START_NS, signed=signed)
    folder = paths[0].parent
    whole = list(times_ns(open_timeline([folder])))
    (folder / name).write_bytes(paths[1].read_bytes())
    timeline = open_timeline([folder])
    assert [segment.path for segment in timeline.segments] == paths
    assert timeline.remarks == (f"{name} is the same segment 2 as {paths[1].name}: left out",)
    assert list(times_ns(timeline)) == whole
    assert len(read_samples([folder]).samples) == len(read_samples(paths).samples)


def test_a_copy_of_a_recording_without_a_number_is_left_out(write_run: WriteRun, tmp_path: Path) -> None:
    (path,) = write_run(range(10))
    (tmp_path / "zone.mcap").write_bytes(path.read_bytes())
    assert open_timeline([tmp_path]).remarks == (f"zone.mcap is the same as {path.name}: left out",)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_copy_that_differs_in_a_bit_is_not_left_out(record: Record, share: float) -> None:
    """Its statement, its checksum and its size are those of the other."""
    paths = record(START_NS)
    content = bytearray(paths[1].read_bytes())
    content[int(share * len(content))] ^= 1
    other = paths[1].with_name("zone.mcap")
    other.write_bytes(content)
    timeline = open_timeline([paths[0].parent])
    assert {segment.path for segment in timeline.segments} == {*paths, other}
    assert timeline.remarks == ()


def utc_ns(text: str) -> int:
    return int(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()) * 10**9


def extent(first: str = "2026-11-22T07:30:00", length_s: float = 600.0, first_s: float = 0.0) -> RecordingExtent:
    return RecordingExtent(first_s, first_s + length_s, utc_ns(first) - round(first_s * 1e9))


@pytest.mark.parametrize(
    ("text", "expected_s"),
    [
        ("30", 30.0),
        ("30.25", 30.25),
        ("1:30", 90.0),
        ("1:05.5", 65.5),
        ("90:00", 5400.0),
        ("07:30:05", 5.0),
        ("07:30:05.5Z", 5.5),
        ("07:29:00", -60.0),
        ("2026-11-22T07:31:00Z", 60.0),
        ("2026-11-22T07:31:00.125", 60.125),
        ("2026-11-22T08:31:00+01:00", 60.0),
        ("20261122T073100Z", 60.0),
    ],
)
@pytest.mark.parametrize("first_s", [0.0, 1000.0])
def test_times_are_seconds_from_the_start_or_utc(text: str, expected_s: float, first_s: float) -> None:
    time_s = parse_recording_time(text).time_s(extent(first_s=first_s))
    assert time_s == pytest.approx(first_s + expected_s, abs=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "-5",
        "1e3",
        "nan",
        "1:60",
        "1:2:3:4",
        "1:00:00",
        "24:00:00",
        "07:60:00",
        "1.5:30",
        "30Z",
        "1:30Z",
        "now",
        "²",
        "9" * 400,
    ],
)
def test_other_texts_are_no_times(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        parse_recording_time(text)


def test_hours_and_minutes_of_the_recording_are_not_taken_for_minutes_in_silence() -> None:
    with pytest.raises(
        InputError, match="07:35: is 07:35:00 of this recording's day, or 455 s from its start; write which"
    ):
        parse_recording_time("07:35").time_s(extent())
    assert parse_recording_time("07:35").time_s(extent("2026-11-22T09:00:00")) == 455.0
    assert parse_recording_time("7:35").time_s(extent()) == 455.0


def test_time_of_day_after_midnight_is_on_the_next_day() -> None:
    night = extent("2026-11-22T23:59:00", 120.0)
    assert parse_recording_time("00:00:30").time_s(night) == 90.0
    assert parse_recording_time("23:59:30").time_s(night) == 30.0
    assert parse_recording_time("00:02:00").time_s(night) < 0  # not in the recording


@pytest.fixture
def tokyo(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run in a time zone nine hours ahead of UTC."""
    monkeypatch.setenv("TZ", "JST-9")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.usefixtures("tokyo")
@pytest.mark.parametrize(
    ("text", "expected_s"),
    [
        ("16:30:05", 5.0),
        ("2026-11-22T16:31:00", 60.0),
        ("07:30:05Z", 5.0),
        ("2026-11-22T07:31:00Z", 60.0),
        ("30", 30.0),
    ],
)
def test_local_times_are_of_the_zone_of_this_computer_unless_they_state_another(text: str, expected_s: float) -> None:
    assert parse_recording_time(text, is_local=True).time_s(extent()) == pytest.approx(expected_s, abs=1e-6)


@pytest.mark.usefixtures("tokyo")
def test_local_time_of_day_after_local_midnight_is_on_the_next_day() -> None:
    night = extent("2026-11-22T14:59:00", 120.0)
    assert parse_recording_time("00:00:30", is_local=True).time_s(night) == 90.0


@pytest.mark.parametrize(("text", "expected_s"), [("90", 90.0), ("1:30", 90.0), ("0.5", 0.5), ("1:01:05", 3665.0)])
def test_durations_are_seconds_minutes_or_hours(text: str, expected_s: float) -> None:
    assert parse_duration(text) == expected_s


@pytest.mark.parametrize("text", ["", "0", "-1", "1:60", "1:60:00", "1:2:3:4", "nan", "1h"])
def test_other_texts_are_no_durations(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        parse_duration(text)


def test_last_part_ends_with_the_recording_or_before_the_end_given() -> None:
    assert RecordingInterval(last_s=20.0).limits_s(extent()) == (580.0, float("inf"))
    assert RecordingInterval(end=parse_recording_time("100"), last_s=20.0).limits_s(extent()) == (80.0, 100.0)
    assert RecordingInterval(last_s=700.0).limits_s(extent())[0] == -100.0


def test_printed_times_are_accepted_again() -> None:
    time_ns = utc_ns("2026-11-22T07:31:00") + 125_000_000
    assert parse_recording_time(iso_utc(time_ns)).value_ns == time_ns


def interval(begin: str | None, end: str | None) -> RecordingInterval:
    return RecordingInterval(*(None if text is None else parse_recording_time(text) for text in (begin, end)))


def test_missing_limits_are_open() -> None:
    assert interval(None, None).limits_s(extent()) == (float("-inf"), float("inf"))
    assert interval("10", "20").limits_s(extent()) == (10.0, 20.0)


@pytest.mark.parametrize(
    ("begin", "end", "text"),
    [
        ("700", None, "--from 700: is after the recording, which is 0 to 600.000 s, 2026-11-22T07:30:00.000Z to"),
        (None, "07:29:59", "--to 07:29:59: is before the recording, which is 0 to 600.000 s"),
        ("20", "10", "--to 10: is not after --from 20; the recording is 0 to 600.000 s"),
    ],
)
def test_an_interval_outside_the_recording_is_refused_with_its_extent(
    begin: str | None, end: str | None, text: str
) -> None:
    with pytest.raises(InputError, match=text.replace(".", r"\.")):
        interval(begin, end).limits_s(extent())


def test_utc_needs_a_recording_with_utc() -> None:
    with pytest.raises(InputError, match="07:30:05: this recording has no UTC; give seconds from its start, 0 to 45"):
        interval("07:30:05", None).limits_s(RecordingExtent(5.0, 50.0, None))


def test_limits_beyond_the_recording_are_remarked() -> None:
    assert interval("0", "600").describe_excess(extent()) == ()
    begin, end = interval("07:29:00", "700").describe_excess(extent())
    assert begin.startswith("--from 07:29:00 is before the recording, which is 0 to 600.000 s")
    assert end.startswith("--to 700 is after the recording")
