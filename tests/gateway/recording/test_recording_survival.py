"""What is left of a recording after SIGKILL, a cut at any byte, and damage in the middle; a short form of the survival campaign.

`python -m tests.benchmarks.survival` runs all of the campaign.
"""

import errno
import io
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from devices.errors import RecordingError
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.export.info_text import info_text
from gateway.recording.format import mcap_writer
from gateway.recording.format.salvage import SalvageReport
from gateway.recording.reading.recording_file import is_altered, open_recording, read_index
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.copying import recover
from gateway.recording.segments.recorder import Recorder
from tests.benchmarks.survival import campaign, content, record, specimen
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import DEVICE, EVERY_MESSAGE, HEADER, MakeRecorder, make_alert
from tests.gateway.recording.recorded_files import sample_sequences, summarise

BLOCK = 32
FSYNC_S = 1.0

RECORD_IN_REAL_TIME = """
import pickle, sys, time
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.segments.recorder import Recorder
header, made, folder = pickle.load(sys.stdin.buffer)
recorder = Recorder(folder, header, segment_s=600, fsync_s=1.0, quota_mb=100)
first_ns = made[0].first_log_time_ns
recorder.start(first_ns)
began_s = time.monotonic()
for message in made:
    time.sleep(max(0.0, began_s + (message.time_ns - first_ns) / 1e9 - time.monotonic()))
    recorder.write(encode_message("samples", message, message.time_ns))
    recorder.tick(message.time_ns)
    print(message.sequence, flush=True)
"""


@pytest.fixture
def small(make_recorder: MakeRecorder) -> tuple[Path, list[int]]:
    """A closed file of 12 short blocks and one message of each other topic, and where its syncs ended."""
    recorder: Recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    ends = [path.stat().st_size]
    for number in range(12):
        now_ns = START_NS + number * 400_000_000
        recorder.write(encode_message("samples", make_samples(number, length=4), now_ns))
        if number == 1:
            others = {**EVERY_MESSAGE, "alert": make_alert("standing")}  # a change would be synced at once
            for topic in set(others) - {"samples"}:
                recorder.write(encode_message(topic, others[topic], now_ns))
        recorder.tick(now_ns)
        if path.stat().st_size > ends[-1]:
            ends.append(path.stat().st_size)
    recorder.close()
    return path, ends


@pytest.mark.slow
def test_sigkill_costs_at_most_fsync_s_and_one_block(tmp_path: Path) -> None:
    made = [make_samples(number, length=BLOCK, period_ns=1e6) for number in range(1000)]
    command = [sys.executable, "-c", RECORD_IN_REAL_TIME]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=Path(__file__).parents[3]
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        child.stdin.write(pickle.dumps((HEADER, made, tmp_path)))
        child.stdin.close()
        written = -1
        for line in child.stdout:
            written = int(line)
            if written >= 83:  # 2.7 s: two syncs are through, most of a second is not
                os.kill(child.pid, signal.SIGKILL)
                break
        written = max([written, *map(int, child.stdout.read().split())])
    assert child.returncode == -signal.SIGKILL
    (path,) = tmp_path.glob("*.mcap")
    kept = sample_sequences(path)
    assert kept == list(range(len(kept)))
    assert (written + 1 - len(kept)) * BLOCK <= FSYNC_S * 1000 + BLOCK
    assert not open_recording(path).losses.closed
    assert summarise(path).samples.count == len(kept) * BLOCK


@pytest.mark.slow
def test_truncation_at_any_byte_keeps_every_chunk_before_it(small: tuple[Path, list[int]], tmp_path: Path) -> None:
    path, ends = small
    whole = path.read_bytes()
    expected = [sample_sequences(cut_to(tmp_path, whole, end)) for end in ends]
    assert [len(numbers) for numbers in expected] == [0, 4, 7, 10]
    rng = np.random.default_rng(5)
    sizes = {*range(40), *(end + shift for end in ends for shift in (-1, 0, 1)), *rng.integers(0, len(whole), 200)}
    for size in sorted(sizes):
        cut = cut_to(tmp_path, whole, int(size))
        due = max((numbers for numbers, end in zip(expected, ends, strict=True) if end <= size), key=len, default=[])
        try:
            numbers = sample_sequences(cut)
        except RecordingError:
            numbers = []
        assert numbers == list(range(len(numbers)))
        assert len(numbers) >= len(due), size
        read_as_users_do(cut)


def cut_to(folder: Path, whole: bytes, size: int) -> Path:
    cut = folder / "cut.mcap"
    cut.write_bytes(whole[:size])
    return cut


def read_as_users_do(path: Path) -> None:
    for read in (lambda path: read_samples([path]), lambda path: info_text(summarise(path))):
        try:
            read(path)
        except RecordingError as error:
            text = str(error)
        else:
            text = str(path)
        assert str(path) in text
        assert "\n" not in text


def test_every_chunk_but_the_damaged_one_is_read(small: tuple[Path, list[int]], tmp_path: Path) -> None:
    path, ends = small
    whole = bytearray(path.read_bytes())
    middle = (ends[1] + ends[2]) // 2 - 60  # in the compressed content of the second chunk of samples
    whole[middle] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(whole)
    assert sample_sequences(damaged) == [0, 1, 2, 3, 7, 8, 9, 10, 11]
    info = summarise(damaged)
    assert (info.losses.damaged_records, info.samples.missing_blocks, info.closed) == (1, 3, True)
    assert "1 damaged record left out" in info_text(info)


@pytest.mark.slow
def test_a_flipped_bit_anywhere_raises_nothing_but_recording_errors(
    small: tuple[Path, list[int]], tmp_path: Path
) -> None:
    whole = small[0].read_bytes()
    rng = np.random.default_rng(6)
    flipped = tmp_path / "flipped.mcap"
    for place in rng.integers(0, len(whole), 300):
        changed = bytearray(whole)
        changed[place] ^= 1 << int(rng.integers(0, 8))
        flipped.write_bytes(changed)
        read_as_users_do(flipped)


class BadSector(io.FileIO):
    """A file of which only the beginning can still be read."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or size < 0 or self.tell() + size > 4096:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return super().read(size)


def test_a_disk_that_fails_is_named_by_every_reader(
    small: tuple[Path, list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _ = small
    index = read_index(path)
    monkeypatch.setattr("gateway.recording.format.salvage.open_regular", BadSector)
    for read in (
        lambda: is_altered(index),
        lambda: read_index(path),
        lambda: verify_file(path, None),
        lambda: sample_sequences(path),
    ):
        with pytest.raises(RecordingError, match="Input/output error; copy it off this disk with `ddrescue`"):
            read()


def test_changed_metadata_are_detected_in_a_closed_file(small: tuple[Path, list[int]], tmp_path: Path) -> None:
    altered = tmp_path / "altered.mcap"
    altered.write_bytes(small[0].read_bytes().replace(b"256000.0", b"255000.0"))
    assert read_samples([altered]).losses == SalvageReport(closed=True, altered=True)
    assert "CHECKSUM WRONG" in info_text(summarise(altered))


def test_zeros_after_the_data_are_an_incomplete_end(small: tuple[Path, list[int]], tmp_path: Path) -> None:
    path, ends = small
    padded = tmp_path / "padded.mcap"
    padded.write_bytes(path.read_bytes()[: ends[2]] + bytes(4096))
    file = open_recording(padded)
    assert len([message for message in file.messages() if message.topic == "/samples"]) == 7
    assert (file.losses.closed, file.losses.torn_bytes) == (False, 4096)


def test_the_mcap_reader_agrees_on_a_complete_file(small: tuple[Path, list[int]]) -> None:
    path, _ = small
    with path.open("rb") as file:
        public = [(channel.topic, message.data) for _, channel, message in make_reader(file).iter_messages()]
    recording = open_recording(path)
    assert sorted((message.topic, message.data) for message in recording.messages()) == sorted(public)
    assert recording.losses == SalvageReport(closed=True)


@pytest.mark.slow
def test_kills_crashes_and_power_failures_at_every_call_to_the_disk_cost_at_most_the_sync_interval() -> None:
    found = campaign(kills=3, truncations=0, flips=0, seed=2)
    assert found.defects == []
    assert found.rounds["kill"] == 3
    assert min(found.rounds["crash"], found.rounds["power failure"]) > 40


@pytest.mark.slow
def test_cuts_and_flipped_bits_cost_at_most_their_chunk_and_nothing_wrong_is_read() -> None:
    found = campaign(kills=0, truncations=300, flips=600, seed=2)
    assert found.defects == []
    assert found.rounds == {"truncation": 300, "bit flip": 600}


@pytest.mark.parametrize("compacted", [False, True])
def test_the_schemas_are_recovered_when_the_first_chunk_is_destroyed(
    tmp_path: Path, compacted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_writer, "CHUNK_BYTES", 8192)
    of = specimen(tmp_path, compacted, blocks=60)
    begin, end, lost = of.chunks[0]
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(of.whole[: begin + 60] + bytes(end - begin - 60) + of.whole[end:])
    recover(damaged, tmp_path / "out.mcap")
    assert content(tmp_path / "out.mcap") == of.blocks[len(lost) :]


def test_the_second_chunk_has_the_schemas_of_an_incomplete_file_too(tmp_path: Path) -> None:
    path = record(tmp_path, 60)
    of = specimen(tmp_path / "other", compacted=False, blocks=60)
    begin, end, _ = of.chunks[0]
    torn = of.whole[: begin + 60] + bytes(end - begin - 60) + of.whole[end : of.chunks[-1][1]]
    path.write_bytes(torn)
    file = open_recording(path)
    read = [message.sequence for message in file.messages() if message.topic == "/samples"]
    assert read == [number for number, _ in of.blocks][len(of.chunks[0][2]) :]
    assert {schema.name for schema in file.schemas.values()} >= {"plumbline.Samples", "plumbline.Motion"}


@pytest.mark.slow
@pytest.mark.parametrize("length", [0, 2**40])
def test_chunks_behind_a_wrong_length_are_found_again(tmp_path: Path, length: int) -> None:
    of = specimen(tmp_path, compacted=False)
    begin, _, lost = of.chunks[2]
    changed = bytearray(of.whole)
    changed[begin + 1 : begin + 9] = length.to_bytes(8, "little")
    of.path.write_bytes(changed)
    assert content(of.path) == [block for block in of.blocks if block[0] not in lost]
