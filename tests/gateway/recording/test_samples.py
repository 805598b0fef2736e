"""Files of one gateway that are read as one recording."""

import os
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from devices.block import DeviceInfo
from devices.errors import RecordingError
from gateway.errors import InputError
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import RecordingHeader
from gateway.recording.reading.interval import RecordingInterval, parse_recording_time
from gateway.recording.reading.samples import PART_BLOCKS, SampleReader, read_samples
from gateway.recording.reading.timeline import NoMessageError, list_recordings, open_timeline
from gateway.recording.segments.recorder import Recorder
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import DEVICE, HEADER, MakeRecorder, make_calibration

Write = Callable[..., Path]
BLOCK = 32
PERIOD_NS = 1_000_000
SLOW_NS = 12_500_000


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a closed segment with the blocks of these numbers, at 1 kHz without gaps between consecutive numbers."""

    def write(
        name: str,
        numbers: Sequence[int],
        header: RecordingHeader = HEADER,
        device: DeviceInfo = DEVICE,
        calibration: str = "a",
        length: int = BLOCK,
        period_ns: int = PERIOD_NS,
    ) -> Path:
        recorder = Recorder(tmp_path, header, segment_s=6000.0, fsync_s=0.01, quota_mb=100.0)
        made = [make_samples(number, length=length, period_ns=period_ns) for number in numbers]
        start_ns = made[0].first_log_time_ns if made else 0
        recorder.set_device(device, start_ns)
        path = recorder.start(start_ns)
        in_force = replace(make_calibration(calibration), sequence=max(numbers, default=0))
        recorder.write(encode_message("calibration", in_force, start_ns))
        for message in made:
            recorder.write(encode_message("samples", message, message.time_ns))
            if period_ns == PERIOD_NS:
                recorder.tick(message.time_ns)
        recorder.close()
        return path.rename(tmp_path / name)

    return write


def test_segments_are_joined_in_order_of_time(write: Write) -> None:
    whole = write("whole.mcap", range(6))
    parts = [write("1.mcap", range(2, 6)), write("2.mcap", range(2))]
    joined = read_samples(parts)
    assert [part.path.name for part in joined.files] == ["2.mcap", "1.mcap"]
    assert joined.remarks == ()
    expected, found = read_samples([whole]).recording(), joined.recording()
    for name in ("time_s", "raw", "lost_before", "unusable_before", "temperature_c"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert found.origin_ns == expected.origin_ns
    assert len(joined.calibrations) == 1


@pytest.mark.slow
@pytest.mark.parametrize("files", [1, 3])
def test_of_an_interval_only_its_samples_are_read_and_those_shortly_before(write: Write, files: int) -> None:
    """Twenty minutes in blocks of 0.4 s; the samples are those of the whole recording."""
    each = 3000 // files
    paths = [
        write(f"{place}.mcap", range(place * each, (place + 1) * each), period_ns=SLOW_NS) for place in range(files)
    ]
    whole = read_samples(paths).recording()
    tracemalloc.start()
    joined = read_samples(paths, RecordingInterval(parse_recording_time("1100"), parse_recording_time("1101")))
    found = joined.recording()
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 56 * len(whole)  # the arrays of the whole recording
    assert 299 < 1100 - found.time_s[0] < 302
    assert 1101 < found.time_s[-1] < 1112
    place = int(np.searchsorted(whole.time_s, found.time_s[0]))
    for name in ("time_s", "raw", "lost_before", "unusable_before", "temperature_c"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name)[place : place + len(found)])
    assert found.origin_ns == whole.origin_ns
    assert len(joined.calibrations) == 1


@pytest.mark.slow
def test_a_recording_takes_the_memory_of_its_samples(write: Write) -> None:
    path = write("a.mcap", range(6000), length=4, period_ns=SLOW_NS)
    tracemalloc.start()
    run = read_samples([path])
    kept_bytes = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert kept_bytes < 50 * len(run.samples)


@pytest.mark.slow
def test_parts_of_a_long_recording_take_no_more_memory(write: Write) -> None:
    peaks_bytes = []
    for name, blocks in (("short.mcap", 3 * PART_BLOCKS), ("long.mcap", 9 * PART_BLOCKS)):
        timeline = open_timeline([write(name, range(blocks), length=4, period_ns=SLOW_NS)])
        samples, end_s = 0, -1.0
        tracemalloc.start()
        for part in SampleReader(timeline).recordings():
            assert end_s < part.time_s[0]
            samples, end_s = samples + len(part), float(part.time_s[-1])
        peaks_bytes.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert samples == 4 * blocks
        assert end_s == pytest.approx((4 * blocks - 1) * SLOW_NS / 1e9)
    short_bytes, long_bytes = peaks_bytes
    assert long_bytes < 1.2 * short_bytes


def test_parts_of_a_recording_state_the_gap_before_them(write: Write) -> None:
    paths = [write("a.mcap", range(3)), write("b.mcap", range(5, 8))]
    first, second = SampleReader(open_timeline(paths)).recordings()
    assert (first.lost, second.lost_before[0]) == (0, 2 * BLOCK)
    assert first.origin_ns == second.origin_ns


def test_an_interval_without_samples_is_refused(write: Write) -> None:
    paths = [write("a.mcap", [0, 1]), write("b.mcap", [100_000])]
    empty = RecordingInterval(parse_recording_time("1600"), parse_recording_time("1700"))
    with pytest.raises(InputError, match=r"fewer than two samples; the recording is 0 to 3200\.031 s"):
        read_samples(paths, empty)


def test_gap_between_segments_is_counted_as_lost_samples(write: Write) -> None:
    joined = read_samples([write("a.mcap", range(3)), write("b.mcap", range(5, 8))])
    assert joined.remarks == ("b.mcap: begins 0.065 s after a.mcap ends, 64 samples lost",)
    recording = joined.recording()
    assert (recording.lost, recording.lost_before[3 * BLOCK]) == (2 * BLOCK, 2 * BLOCK)


@pytest.mark.parametrize("begin", [None, "0.01"])
def test_time_in_which_the_gateway_was_off_is_no_lost_samples(write: Write, begin: str | None) -> None:
    restarted = replace(HEADER, boot_id="b002")
    paths = [write("a.mcap", range(3)), write("b.mcap", range(5, 8), header=restarted), write("c.mcap", range(9, 12))]
    joined = read_samples(paths, RecordingInterval(None if begin is None else parse_recording_time(begin)))
    assert joined.remarks[0] == "b.mcap: begins 0.065 s after a.mcap ends: the gateway was started again"
    lost_before = joined.recording().lost_before
    assert lost_before[3 * BLOCK] == lost_before[6 * BLOCK] == 0


def test_each_change_of_calibration_is_kept(write: Write) -> None:
    paths = [write(f"{place}.mcap", [place], calibration=name) for place, name in enumerate("aab")]
    joined = read_samples(paths)
    assert [each.message.calibration_id for each in joined.calibrations] == ["a", "b"]


@pytest.mark.slow
def test_incomplete_file_is_read_up_to_its_end(write: Write) -> None:
    complete, torn = write("a.mcap", range(4)), write("b.mcap", range(4, 80))
    os.truncate(torn, torn.stat().st_size // 2)
    joined = read_samples([complete, torn])
    samples = len(joined.recording())
    assert 4 * BLOCK < samples < 80 * BLOCK
    (remark,) = joined.remarks
    assert remark.startswith("b.mcap: not closed: incomplete, or still being written, ")
    assert remark.endswith(f"samples up to 2026-01-01T00:00:{(samples - 1) / 1000:06.3f}Z")
    assert not joined.losses.closed


def test_open_segment_of_a_running_gateway_is_read(write: Write, make_recorder: MakeRecorder) -> None:
    closed, number = write("a.mcap", range(4)), 4
    recorder = make_recorder()
    first = make_samples(number, length=BLOCK, period_ns=PERIOD_NS)
    recorder.set_device(DEVICE, first.first_log_time_ns)
    path = recorder.start(first.first_log_time_ns)
    empty = read_samples([closed, path])
    (remark,) = empty.remarks
    assert remark.startswith(f"{path}: has no message; ")
    assert remark.endswith("left out")
    with pytest.raises(NoMessageError, match="has no message"):
        read_samples([path])
    recorder.write(encode_message("samples", first, first.time_ns))
    recorder.tick(first.time_ns + 2_000_000_000)
    assert len(read_samples([closed, path]).recording()) == 5 * BLOCK
    recorder.close()


def test_times_that_occur_in_two_files_are_refused(write: Write) -> None:
    first, later = write("a.mcap", range(4)), write("c.mcap", range(3, 7))
    other = write("b.mcap", range(4), calibration="b")
    with pytest.raises(RecordingError, match=r"b\.mcap: overlaps .*a\.mcap by 0\.127 s; give one of them"):
        read_samples([first, other])
    with pytest.raises(RecordingError, match=r"c\.mcap: overlaps .*a\.mcap by 0\.031 s; give one of them"):
        read_samples([later, first])


def test_files_of_different_gateways_are_refused(write: Write) -> None:
    paths = [write("a.mcap", [0]), write("b.mcap", [1], header=replace(HEADER, crane="crane-3"))]
    expected = (
        r"b\.mcap: is of gateway yard/crane-3/hook, .*a\.mcap of yard/crane-2/hook; give the files of one gateway"
    )
    with pytest.raises(RecordingError, match=expected):
        read_samples(paths)


def test_restart_and_update_of_the_gateway_are_accepted(write: Write) -> None:
    paths = [write("a.mcap", [0]), write("b.mcap", [1], header=replace(HEADER, boot_id="another", software="0.2.0"))]
    assert len(read_samples(paths).files) == 2


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"device_id": "part-8"}, r"device\.device_id \(part-8, not adxl355-0x1d-label7\)"),
        ({"odr_hz": 500.0}, r"device\.odr_hz \(500\.0, not 1000\.0\)"),
        ({"factory_calibration": {"id": "x"}}, r"device\.factory_calibration than"),
    ],
)
def test_files_of_different_devices_are_refused(write: Write, change: dict[str, object], text: str) -> None:
    paths = [write("a.mcap", [0]), write("b.mcap", [1], device=replace(DEVICE, **change))]  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match=rf"b\.mcap: has another {text}.* give the files of one device and rate"):
        read_samples(paths)


def test_a_folder_stands_for_its_recordings(write: Write, tmp_path: Path) -> None:
    paths = [write("a.mcap", [0]), write("b.mcap", [1])]
    (tmp_path / ".lock").write_text("1")
    (tmp_path / ".c.mcap.part").write_text("")
    assert list_recordings([tmp_path]) == paths
    with pytest.raises(RecordingError, match=r"a\.mcap: is given twice"):
        list_recordings([paths[0], tmp_path])
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"empty: contains no \.mcap file"):
        list_recordings([tmp_path / "empty"])
