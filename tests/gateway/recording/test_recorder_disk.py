"""What is synced when, and what a kill, a full disk or a failed sync leaves behind."""

import errno
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway import messages
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import RecordingHeader
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.recorder import RecorderError
from tests.gateway.recording.conftest import MakeRecorder
from tests.gateway.recording.recorded_files import SECOND_NS, names, record_blocks, sample_sequences, segments


def test_messages_are_in_the_file_after_fsync_s(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int
) -> None:
    recorder = make_recorder(fsync_s=1.0)
    path = recorder.start(start_ns)
    recorder.write(encode_message("samples", make_samples(0), start_ns))
    recorder.tick(start_ns + SECOND_NS - 1)
    assert list(open_recording(path).messages()) == []
    recorder.tick(start_ns + SECOND_NS)
    assert [message.topic for message in open_recording(path).messages()] == ["/samples"]
    recorder.close()


def test_the_file_and_its_name_are_synced(
    make_recorder: MakeRecorder,
    make_samples: Callable[..., messages.Samples],
    start_ns: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    synced: list[str] = []
    real_fsync = os.fsync

    def noted_fsync(descriptor: int) -> None:
        synced.append(str(Path(f"/proc/self/fd/{descriptor}").readlink()))
        real_fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    recorder = make_recorder()
    path = recorder.start(start_ns)
    assert synced == [str(path.parent / f".{path.name}.part"), str(path.parent)]  # the name comes last
    synced.clear()
    recorder.write(encode_message("samples", make_samples(0), start_ns))
    recorder.tick(start_ns + SECOND_NS)
    assert synced == [str(path)]
    recorder.close()


def test_a_kill_at_the_start_of_a_segment_leaves_no_recording(
    make_recorder: MakeRecorder, start_ns: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        """Nothing of the recorder's runs after it."""

    def killed(_: int) -> None:
        raise Killed

    recorder = make_recorder()
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", killed)
        with pytest.raises(Killed):
            recorder.start(start_ns)
    (partial,) = names(tmp_path)
    path = make_recorder().start(start_ns)  # the next one, within the same second
    assert partial == f".{path.name}.part"
    assert names(tmp_path) == [path.name, f"{path.name}.live"]
    assert list(open_recording(path).messages()) == []


def test_messages_before_the_start_are_counted_as_lost(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int
) -> None:
    recorder = make_recorder()
    with pytest.raises(RecorderError) as caught:
        recorder.write(encode_message("samples", make_samples(0), start_ns))
    assert (caught.value.lost_messages, caught.value.lost_samples) == (1, 32)
    recorder.tick(start_ns)
    recorder.close()
    assert recorder.path is None


def test_an_impossible_folder_is_reported_with_the_remedy(
    make_recorder: MakeRecorder, start_ns: int, tmp_path: Path
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    for data_dir in (blocked, blocked / "below"):
        with pytest.raises(RecorderError, match=r"gateway\.data_dir is not a folder") as caught:
            make_recorder(data_dir).start(start_ns)
        assert str(data_dir) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_recording_can_start_again_after_a_failed_sync(
    make_recorder: MakeRecorder,
    make_samples: Callable[..., messages.Samples],
    start_ns: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recorder = make_recorder()
    path = recorder.start(start_ns)
    record_blocks(recorder, make_samples, range(40), start_ns)

    def broken_fsync(descriptor: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as broken:
        broken.setattr(os, "fsync", broken_fsync)
        with pytest.raises(RecorderError, match=f"{path.name} stopped: Input/output error; the disk") as caught:
            recorder.tick(start_ns + 10 * SECOND_NS)
        assert recorder.path is None
        with pytest.raises(RecorderError):
            recorder.start(start_ns + 11 * SECOND_NS)
    assert (caught.value.lost_messages, caught.value.lost_samples) == (7, 224)  # block 32 was synced, 39 is the last
    assert segments(path.parent) == [path]  # the try that failed left no empty file
    second = recorder.start(start_ns + 12 * SECOND_NS)
    recorder.write(encode_message("samples", make_samples(40), start_ns + 12 * SECOND_NS))
    recorder.close()
    assert len(sample_sequences(path)) >= 33
    assert sample_sequences(second) == [40]


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


@pytest.mark.slow
def test_a_full_disk_stops_the_recording_and_leaves_complete_chunks(
    header: RecordingHeader, make_samples: Callable[..., messages.Samples], start_ns: int, tmp_path: Path
) -> None:
    made = [make_samples(number) for number in range(700)]
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK],
        input=pickle.dumps((header, made, tmp_path, start_ns)),
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
