"""A recorder writes every topic into a file that states its origin, and is small; segments follow each other without a gap.

What is synced when, and what a kill, a full disk or a failed sync leaves behind.
"""

import errno
import itertools
import json
import os
import pickle
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader

from gateway import messages
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import encode_recorded
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.recorder import RecorderError
from gateway.topics import TOPICS, adapter
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import (
    DEVICE,
    EVERY_MESSAGE,
    HEADER,
    SECOND_NS,
    MakeRecorder,
    make_alert,
    make_calibration,
)
from tests.gateway.recording.recorded_files import contents, names, record_blocks, sample_sequences, segments

FULL_DISK = """
import pickle, resource, sys
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.segments.recorder import Recorder, RecorderError
header, made, folder, start_ns = pickle.load(sys.stdin.buffer)
recorder = Recorder(folder, header, segment_s=600, fsync_s=1.0, quota_mb=100)
recorder.start(start_ns)
resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
lost = 0
for number, message in enumerate(made):
    now_ns = start_ns + number * 32_000_000
    try:
        recorder.write(encode_message("samples", message, now_ns))
        recorder.tick(now_ns)
    except RecorderError as error:
        if recorder.path is None and not lost:
            print(error)
        lost += error.lost_messages
print(lost)
"""


def test_the_mcap_reader_reads_every_topic(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    for topic, message in EVERY_MESSAGE.items():
        recorder.write(encode_message(topic, message, START_NS + 99))
    recorder.close()
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = {channel.topic: (schema, channel, message) for schema, channel, message in reader.iter_messages()}
        summary = reader.get_summary()
    assert set(found) == {topic.path for topic in TOPICS.values() if topic.logged}
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(EVERY_MESSAGE)
    for topic, message in EVERY_MESSAGE.items():
        schema, channel, recorded = found[f"/{topic}"]
        assert schema is not None
        assert (schema.encoding, schema.name, channel.message_encoding) == (
            "jsonschema",
            TOPICS[topic].schema_name,
            "json",
        )
        assert json.loads(schema.data)["type"] == "object"
        assert recorded.data == encode_recorded(message)
        assert adapter(topic).validate_json(recorded.data) == message
        assert recorded.log_time == START_NS + 99
        stamp = (0, START_NS + 5) if isinstance(message, messages.Log) else (message.sequence, message.time_ns)
        assert (recorded.sequence, recorded.publish_time) == stamp


def test_a_file_states_its_origin(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    recorder.close()
    assert path.name == "yard-crane-2-hook-20260101T000000Z.mcap"
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "plumbline"
        assert "plumbline 0.1.0" in reader.get_header().library
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachment, _ = reader.iter_attachments()
    assert metadata["plumbline"].items() >= {"software": "0.1.0", "boot_id": "b00t", "crane": "crane-2"}.items()
    assert metadata["device"].items() >= {"device_id": DEVICE.device_id, "units_per_g": "256000.0"}.items()
    assert (attachment.name, attachment.media_type) == ("configuration.toml", "application/toml")
    assert tomllib.loads(attachment.data.decode()) == {"gateway": {"site": "yard"}}


@pytest.mark.parametrize("log_time_ns", [-1, 2**63])
def test_an_impossible_time_is_refused(make_recorder: MakeRecorder, log_time_ns: int) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    with pytest.raises(ValueError, match="/samples"):
        recorder.write(encode_message("samples", make_samples(1), log_time_ns))
    recorder.write(encode_message("samples", make_samples(2), START_NS))
    recorder.close()
    assert [content["sequence"] for _, content in contents(path)] == [0, 2]


@pytest.mark.slow
def test_bytes_per_sample_of_an_adxl355_at_rest(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    sizes = [path.stat().st_size]
    for second in range(3):
        blocks = range(second * 320, (second + 1) * 320)  # 10.24 s
        record_blocks(recorder, blocks)
        recorder.tick(START_NS + round((second + 1) * 10.24e9) + SECOND_NS)
        sizes.append(path.stat().st_size)
    recorder.close()
    steady = [(after - before) / 10_240 for before, after in itertools.pairwise(sizes[1:])]
    assert max(steady) <= 8.0


@pytest.mark.slow
def test_segments_are_contiguous_and_complete_in_themselves(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder(segment_s=2.0)
    recorder.set_device(DEVICE, START_NS)
    folder = recorder.start(START_NS).parent
    calibration = EVERY_MESSAGE["calibration"]
    assert isinstance(calibration, messages.Calibration)
    recorder.write(encode_message("calibration", replace(calibration, status="uncalibrated"), START_NS))
    recorder.write(encode_message("calibration", calibration, START_NS))
    recorder.write(encode_message("clock", EVERY_MESSAGE["clock"], START_NS))
    record_blocks(recorder, range(200))
    recorder.close()
    files = segments(folder)
    assert len(files) == 4
    numbers = []
    for path in files:
        found = contents(path)
        assert {topic for topic, _ in found} == {"/samples", "/calibration", "/clock"}
        run = read_samples([path])
        assert (run.device, run.files[0].metadata["plumbline"]["crane"]) == (DEVICE, "crane-2")
        assert run.files[0].configuration_toml is not None
        assert run.calibrations[-1].message == EVERY_MESSAGE["calibration"]
        numbers += [content["sequence"] for topic, content in found if topic == "/samples"]
    assert numbers == list(range(200))
    assert [topic for topic, _ in contents(files[1])][:2] == ["/calibration", "/clock"]


@pytest.mark.slow
def test_a_segment_ends_before_it_fills_a_quarter_of_the_quota(make_recorder: MakeRecorder, tmp_path: Path) -> None:
    recorder = make_recorder(quota_mb=1.0)
    recorder.start(START_NS)
    record_blocks(recorder, range(1200))
    recorder.close()
    sizes = [path.stat().st_size for path in segments(tmp_path)]
    assert len(sizes) == 2
    assert 0.25e6 < sizes[0] < 0.25e6 + 45_000  # a second of samples and the summary with all schemas come on top


@pytest.mark.slow
def test_the_oldest_closed_segments_are_deleted_beyond_the_quota(make_recorder: MakeRecorder, tmp_path: Path) -> None:
    others = ["yard-crane-2-hook-notes.mcap", "yard-crane-2-hook2-20200101T000000Z.mcap", "readme.txt", "store"]
    for name in others[:-1]:
        (tmp_path / name).write_bytes(b"x" * 1_000_000)
    (tmp_path / "store").mkdir()
    torn = tmp_path / "yard-crane-2-hook-20251231T235959Z.mcap"
    torn.write_bytes(b"\x89MCAP0\r\n torn")
    recorder = make_recorder(quota_mb=0.4)
    recorder.start(START_NS)
    record_blocks(recorder, range(1500))
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


def test_an_incomplete_file_of_the_last_run_is_not_changed(make_recorder: MakeRecorder, tmp_path: Path) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    record_blocks(recorder, range(100))
    torn = path.read_bytes()
    recorder.close()
    path.write_bytes(torn[:-1000])
    second = make_recorder()
    assert second.start(START_NS).name == "yard-crane-2-hook-20260101T000000Z-1.mcap"
    second.close()
    assert path.read_bytes() == torn[:-1000]
    assert sample_sequences(path) == list(range(65))  # synced with blocks 32, 64 and 96; the last chunk is torn


def test_another_device_begins_a_new_segment(make_recorder: MakeRecorder, tmp_path: Path) -> None:
    recorder = make_recorder()
    recorder.start(START_NS)
    recorder.set_device(DEVICE, START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.set_device(DEVICE, START_NS)  # the same part came back
    assert len(segments(tmp_path)) == 1
    other = replace(DEVICE, device_id="adxl355-0x53-label8", units_per_g=128_000.0)
    recorder.set_device(other, START_NS + 5 * SECOND_NS)
    recorder.write(encode_message("samples", make_samples(1), START_NS + 5 * SECOND_NS))
    recorder.close()
    assert [read_samples([path]).device for path in segments(tmp_path)] == [DEVICE, other]


def test_a_calibration_is_in_the_next_segment_after_a_pause(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    with pytest.raises(RecorderError):
        recorder.write(encode_message("calibration", make_calibration("c-9"), START_NS))
    path = recorder.start(START_NS)
    recorder.close()
    assert [content["calibration_id"] for _, content in contents(path)] == ["c-9"]


def test_messages_are_in_the_file_after_fsync_s(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder(fsync_s=1.0)
    path = recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.tick(START_NS + SECOND_NS - 1)
    assert list(open_recording(path).messages()) == []
    recorder.tick(START_NS + SECOND_NS)
    assert [message.topic for message in open_recording(path).messages()] == ["/samples"]
    recorder.close()


def test_a_change_of_an_alert_is_in_the_file_at_once(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder(fsync_s=60.0)
    path = recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.write(encode_message("alert", make_alert("standing"), START_NS))
    recorder.tick(START_NS + 1)
    assert list(open_recording(path).messages()) == []
    recorder.write(encode_message("alert", make_alert("raised"), START_NS))
    recorder.tick(START_NS + 2)
    assert [message.topic for message in open_recording(path).messages()] == ["/samples", "/alert", "/alert"]
    recorder.write(encode_message("samples", make_samples(1), START_NS))
    recorder.tick(START_NS + 3)
    assert len(list(open_recording(path).messages())) == 3
    recorder.close()


def test_the_file_and_its_name_are_synced(make_recorder: MakeRecorder, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    real_fsync = os.fsync

    def noted_fsync(descriptor: int) -> None:
        synced.append(str(Path(f"/proc/self/fd/{descriptor}").readlink()))
        real_fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    recorder = make_recorder()
    path = recorder.start(START_NS)
    assert synced == [str(path.parent / f".{path.name}.part"), str(path.parent)]  # the name comes last
    synced.clear()
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.tick(START_NS + SECOND_NS)
    assert synced == [str(path)]
    recorder.close()


def test_a_kill_at_the_start_of_a_segment_leaves_no_recording(
    make_recorder: MakeRecorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        """Nothing of the recorder's runs after it."""

    def killed(_: int) -> None:
        raise Killed

    recorder = make_recorder()
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", killed)
        with pytest.raises(Killed):
            recorder.start(START_NS)
    (partial,) = names(tmp_path)
    path = make_recorder().start(START_NS)  # the next one, within the same second
    assert partial == f".{path.name}.part"
    assert names(tmp_path) == [path.name, f"{path.name}.live"]
    assert list(open_recording(path).messages()) == []


def test_messages_before_the_start_are_counted_as_lost(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    with pytest.raises(RecorderError) as caught:
        recorder.write(encode_message("samples", make_samples(0), START_NS))
    assert (caught.value.lost_messages, caught.value.lost_samples) == (1, 32)
    recorder.tick(START_NS)
    recorder.close()
    assert recorder.path is None


def test_an_impossible_folder_is_reported_with_the_remedy(make_recorder: MakeRecorder, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    for data_dir in (blocked, blocked / "below"):
        with pytest.raises(RecorderError, match=r"gateway\.data_dir is not a folder") as caught:
            make_recorder(data_dir).start(START_NS)
        assert str(data_dir) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_recording_can_start_again_after_a_failed_sync(
    make_recorder: MakeRecorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    record_blocks(recorder, range(40))

    def broken_fsync(descriptor: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as broken:
        broken.setattr(os, "fsync", broken_fsync)
        with pytest.raises(RecorderError, match=f"{path.name} stopped: Input/output error; the disk") as caught:
            recorder.tick(START_NS + 10 * SECOND_NS)
        assert recorder.path is None
        with pytest.raises(RecorderError):
            recorder.start(START_NS + 11 * SECOND_NS)
    assert (caught.value.lost_messages, caught.value.lost_samples) == (7, 224)  # block 32 was synced, 39 is the last
    assert segments(path.parent) == [path]  # the try that failed left no empty file
    second = recorder.start(START_NS + 12 * SECOND_NS)
    recorder.write(encode_message("samples", make_samples(40), START_NS + 12 * SECOND_NS))
    recorder.close()
    assert len(sample_sequences(path)) >= 33
    assert sample_sequences(second) == [40]


@pytest.mark.slow
def test_a_full_disk_stops_the_recording_and_leaves_complete_chunks(tmp_path: Path) -> None:
    made = [make_samples(number) for number in range(700)]
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK],
        input=pickle.dumps((HEADER, made, tmp_path, START_NS)),
        capture_output=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    first, last = done.stdout.decode().splitlines()
    assert "stopped: File too large; check the disk" in first
    (path,) = segments(tmp_path)
    file = open_recording(path)
    numbers = [message.sequence for message in file.messages()]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) + int(last) == 700  # every block is in the file or counted as lost
    assert file.losses.torn_bytes == 0  # what was let through of the last chunk is cut off again
    assert path.stat().st_size > 40_000
