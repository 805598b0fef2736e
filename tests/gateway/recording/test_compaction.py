"""Compaction: fewer bytes and the same content, or the segment as it was."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from devices.block import DeviceInfo, SampleBlock
from gateway import messages
from gateway.packing import pack
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.mcap_writer import McapWriter
from gateway.recording.reading.recording_file import RecordedMessage, open_recording
from gateway.recording.segments.compaction import CompactionError, compact
from gateway.recording.segments.copying import recover, recovered_path
from gateway.recording.segments.events import uncompacted_marker
from tests.gateway.recording.conftest import MakeRecorder

NOISE_COUNTS, BLOCK, SECONDS = 143, 32, 30


@pytest.fixture
def ended(
    make_recorder: MakeRecorder,
    every_message: dict[str, messages.Message | messages.Log],
    device: DeviceInfo,
    start_ns: int,
) -> Path:
    """A closed segment of half a minute at 1 kHz with the noise of an ADXL355, and one message of each other topic."""
    recorder = make_recorder()
    recorder.set_device(device, start_ns)
    path = recorder.start(start_ns)
    rng = np.random.default_rng(3)
    for number in range(SECONDS * 1000 // BLOCK):
        time_ns = start_ns + (np.arange(BLOCK) + number * BLOCK) * 1_000_000
        raw = (np.array([0, 0, 256_000]) + rng.normal(0, NOISE_COUNTS, (BLOCK, 3))).astype(np.int32)
        now_ns = int(time_ns[-1])
        header = {"clock": "synchronised", "sequence": number, "calibration_id": "c-1"}
        message = pack(SampleBlock(time_ns, raw, 25.5), time_ns=now_ns, **header)  # type: ignore[arg-type]
        recorder.write(encode_message("samples", message, now_ns))
        if number == 40:
            for topic in set(every_message) - {"samples"}:
                recorder.write(encode_message(topic, every_message[topic], now_ns))
        recorder.tick(now_ns)
    recorder.close()
    assert recorder.take_uncompacted() == [path]
    return path


def content(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    def entry(message: RecordedMessage) -> tuple[str, int, int, int, bytes]:
        return message.topic, message.log_time_ns, message.publish_time_ns, message.sequence, message.data

    return [entry(message) for message in open_recording(path).messages()]


@pytest.mark.slow
def test_compaction_keeps_every_message_attachment_and_metadata_in_fewer_bytes(ended: Path) -> None:
    before, size = content(ended), ended.stat().st_size
    source = open_recording(ended)
    list(source.messages())
    compact(ended)
    assert content(ended) == before
    copy = open_recording(ended)
    list(copy.messages())
    assert (copy.metadata, set(copy.attachments)) == (source.metadata, set(source.attachments))
    assert ended.stat().st_size < 0.9 * size
    assert not uncompacted_marker(ended).exists()
    with ended.open("rb") as file:
        assert len(list(make_reader(file, validate_crcs=True).iter_messages())) == len(before)


@pytest.mark.slow
def test_noise_of_twenty_bits_takes_less_than_seven_bytes_per_sample(ended: Path) -> None:
    compact(ended)
    with ended.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    stored = sum(index.compressed_size for index in summary.chunk_indexes) + 16 * len(content(ended))
    assert stored / (SECONDS * 1000) < 7.0


@pytest.mark.slow
def test_an_interrupted_segment_is_repaired_and_says_so(ended: Path) -> None:
    whole = content(ended)
    ended.write_bytes(ended.read_bytes()[: ended.stat().st_size // 2])
    kept = content(ended)
    assert 0 < len(kept) < len(whole)
    losses = compact(ended)
    assert losses.torn_bytes > 0
    repaired = open_recording(ended)
    assert content(ended) == kept == whole[: len(kept)]
    list(repaired.messages())
    assert repaired.losses.closed
    assert repaired.metadata["repaired"]["torn_bytes"] == str(losses.torn_bytes)


@pytest.mark.slow
def test_a_damaged_segment_stays_as_it_is(ended: Path) -> None:
    damaged = bytearray(ended.read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    ended.write_bytes(damaged)
    with pytest.raises(CompactionError, match="stays as it is"):
        compact(ended)
    assert ended.read_bytes() == damaged
    assert [path.name for path in ended.parent.iterdir() if path.name.endswith(".part")] == []


@pytest.mark.slow
def test_a_copy_that_is_not_the_same_is_thrown_away(ended: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = ended.read_bytes()
    monkeypatch.setattr(McapWriter, "add_message", forget(McapWriter.add_message))
    with pytest.raises(CompactionError, match="not the same"):
        compact(ended)
    assert ended.read_bytes() == whole


def forget(add: Callable[..., None]) -> Callable[..., None]:
    """Copying that loses every hundredth message."""

    def adding(writer: McapWriter, channel_id: int, sequence: int, *rest: object) -> None:
        if sequence % 100 != 99:
            add(writer, channel_id, sequence, *rest)

    return adding


def test_segments_of_a_former_run_are_listed_for_compaction(
    ended: Path, make_recorder: MakeRecorder, start_ns: int
) -> None:
    recorder = make_recorder()
    recorder.start(start_ns + 60 * 10**9)
    assert recorder.take_uncompacted() == [ended]
    compact(ended)
    assert make_recorder().take_uncompacted() == []


def test_recover_names_its_copy_after_the_source(ended: Path) -> None:
    out = recovered_path(ended)
    assert recover(ended, out).messages == len(content(out))
    assert out.name == ended.name.replace(".mcap", ".recovered.mcap")
