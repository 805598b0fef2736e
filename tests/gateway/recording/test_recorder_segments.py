"""Segments follow each other without a gap, are complete in themselves and stay within the quota."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from devices.block import DeviceInfo
from gateway import messages
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.recorder import RecorderError
from tests.gateway.recording.conftest import MakeRecorder
from tests.gateway.recording.recorded_files import SECOND_NS, contents, record_blocks, sample_sequences, segments


@pytest.mark.slow
def test_segments_are_contiguous_and_complete_in_themselves(
    make_recorder: MakeRecorder,
    make_samples: Callable[..., messages.Samples],
    every_message: dict[str, messages.Message | messages.Log],
    device: DeviceInfo,
    start_ns: int,
) -> None:
    recorder = make_recorder(segment_s=2.0)
    recorder.set_device(device, start_ns)
    folder = recorder.start(start_ns).parent
    calibration = every_message["calibration"]
    assert isinstance(calibration, messages.Calibration)
    recorder.write(encode_message("calibration", replace(calibration, status="uncalibrated"), start_ns))
    recorder.write(encode_message("calibration", calibration, start_ns))
    recorder.write(encode_message("clock", every_message["clock"], start_ns))
    record_blocks(recorder, make_samples, range(200), start_ns)
    recorder.close()
    files = segments(folder)
    assert len(files) == 4
    numbers = []
    for path in files:
        found = contents(path)
        assert {topic for topic, _ in found} == {"/samples", "/calibration", "/clock"}
        run = read_samples([path])
        assert (run.device, run.files[0].metadata["plumbline"]["crane"]) == (device, "crane-2")
        assert run.files[0].configuration_toml is not None
        assert run.calibrations[-1].message == every_message["calibration"]
        numbers += [content["sequence"] for topic, content in found if topic == "/samples"]
    assert numbers == list(range(200))
    assert [topic for topic, _ in contents(files[1])][:2] == ["/calibration", "/clock"]


@pytest.mark.slow
def test_a_segment_ends_before_it_fills_a_quarter_of_the_quota(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int, tmp_path: Path
) -> None:
    recorder = make_recorder(quota_mb=1.0)
    recorder.start(start_ns)
    record_blocks(recorder, make_samples, range(1200), start_ns)
    recorder.close()
    sizes = [path.stat().st_size for path in segments(tmp_path)]
    assert len(sizes) == 2
    assert 0.25e6 < sizes[0] < 0.25e6 + 45_000  # a second of samples and the summary with all schemas come on top


@pytest.mark.slow
def test_the_oldest_closed_segments_are_deleted_beyond_the_quota(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int, tmp_path: Path
) -> None:
    others = ["yard-crane-2-hook-notes.mcap", "yard-crane-2-hook2-20200101T000000Z.mcap", "readme.txt", "store"]
    for name in others[:-1]:
        (tmp_path / name).write_bytes(b"x" * 1_000_000)
    (tmp_path / "store").mkdir()
    torn = tmp_path / "yard-crane-2-hook-20251231T235959Z.mcap"
    torn.write_bytes(b"\x89MCAP0\r\n torn")
    recorder = make_recorder(quota_mb=0.4)
    recorder.start(start_ns)
    record_blocks(recorder, make_samples, range(1500), start_ns)
    open_path = recorder.path
    kept = sorted(set(segments(tmp_path)) - {tmp_path / name for name in others})
    assert open_path in kept
    assert sum(path.stat().st_size for path in kept) <= 0.4e6
    recorder.close()
    assert not torn.exists()
    assert all((tmp_path / name).exists() for name in others)
    first_kept = min(content["sequence"] for topic, content in contents(kept[0]) if topic == "/samples")
    assert first_kept > 0
    assert contents(kept[-1])[-1][1]["sequence"] == 1499


def test_an_incomplete_file_of_the_last_run_is_not_changed(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int, tmp_path: Path
) -> None:
    recorder = make_recorder()
    path = recorder.start(start_ns)
    record_blocks(recorder, make_samples, range(100), start_ns)
    torn = path.read_bytes()
    recorder.close()
    path.write_bytes(torn[:-1000])
    second = make_recorder()
    assert second.start(start_ns).name == "yard-crane-2-hook-20260101T000000Z-1.mcap"
    second.close()
    assert path.read_bytes() == torn[:-1000]
    assert sample_sequences(path) == list(range(65))  # synced with blocks 32, 64 and 96; the last chunk is torn


def test_another_device_begins_a_new_segment(
    make_recorder: MakeRecorder,
    make_samples: Callable[..., messages.Samples],
    device: DeviceInfo,
    start_ns: int,
    tmp_path: Path,
) -> None:
    recorder = make_recorder()
    recorder.start(start_ns)
    recorder.set_device(device, start_ns)
    recorder.write(encode_message("samples", make_samples(0), start_ns))
    recorder.set_device(device, start_ns)  # the same part came back
    assert len(segments(tmp_path)) == 1
    other = replace(device, device_id="adxl355-0x53-label8", units_per_g=128_000.0)
    recorder.set_device(other, start_ns + 5 * SECOND_NS)
    recorder.write(encode_message("samples", make_samples(1), start_ns + 5 * SECOND_NS))
    recorder.close()
    assert [read_samples([path]).device for path in segments(tmp_path)] == [device, other]


def test_a_calibration_is_in_the_next_segment_after_a_pause(
    make_recorder: MakeRecorder, make_calibration: Callable[..., messages.Calibration], start_ns: int
) -> None:
    recorder = make_recorder()
    with pytest.raises(RecorderError):
        recorder.write(encode_message("calibration", make_calibration("c-9"), start_ns))
    path = recorder.start(start_ns)
    recorder.close()
    assert [content["calibration_id"] for _, content in contents(path)] == ["c-9"]
