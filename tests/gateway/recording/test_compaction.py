"""Compaction: fewer bytes and the same content, or the segment as it was; trimming: the time around an event stays."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from devices.block import SampleBlock
from devices.errors import RecordingError
from gateway.packing import pack
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.chain_verification import verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.mcap_writer import McapWriter
from gateway.recording.reading.recording_file import RecordedMessage, open_recording
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.compaction import CompactionError, compact, trim
from gateway.recording.segments.copying import recover, recovered_path
from gateway.recording.segments.events import EventIndex, is_trimmed, uncompacted_marker
from gateway.recording.segments.recorder import Recorder
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

NOISE_COUNTS, BLOCK, SECONDS = 143, 32, 30
PRE_S, POST_S, EVENT_S = 10, 15, 45


@pytest.fixture
def ended(make_recorder: MakeRecorder) -> Path:
    """A closed segment of half a minute at 1 kHz with the noise of an ADXL355, and one message of each other topic."""
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    rng = np.random.default_rng(3)
    for number in range(SECONDS * 1000 // BLOCK):
        time_ns = START_NS + (np.arange(BLOCK) + number * BLOCK) * 1_000_000
        raw = (np.array([0, 0, 256_000]) + rng.normal(0, NOISE_COUNTS, (BLOCK, 3))).astype(np.int32)
        now_ns = int(time_ns[-1])
        header = {"clock": "synchronised", "sequence": number, "calibration_id": "c-1"}
        message = pack(SampleBlock(time_ns, raw, 25.5), time_ns=now_ns, **header)  # type: ignore[arg-type]
        recorder.write(encode_message("samples", message, now_ns))
        if number == 40:
            for topic in set(EVERY_MESSAGE) - {"samples"}:
                recorder.write(encode_message(topic, EVERY_MESSAGE[topic], now_ns))
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


def test_segments_of_a_former_run_are_listed_for_compaction(ended: Path, make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.start(START_NS + 60 * 10**9)
    assert recorder.take_uncompacted() == [ended]
    compact(ended)
    assert make_recorder().take_uncompacted() == []


def test_recover_names_its_copy_after_the_source(ended: Path) -> None:
    out = recovered_path(ended)
    assert recover(ended, out).messages == len(content(out))
    assert out.name == ended.name.replace(".mcap", ".recovered.mcap")


@pytest.fixture
def recorded(tmp_path: Path) -> tuple[list[Path], SegmentChain]:
    """Three segments of 40 s with a block of 32 samples a second, and an alert 5 s into the second one."""
    chain = SegmentChain(tmp_path, "yard/crane-2/hook", load_or_create_key(tmp_path / "signing-key.pem"))
    events = EventIndex(PRE_S, POST_S)
    recorder = Recorder(tmp_path, HEADER, segment_s=40, fsync_s=1.0, quota_mb=100, events=events, chain=chain)
    recorder.set_device(DEVICE, START_NS)
    recorder.start(START_NS)
    recorder.write(encode_message("calibration", make_calibration("c-1"), START_NS))
    for second in range(120):
        now_ns = START_NS + second * SECOND_NS
        samples = make_samples(second, length=32, period_ns=31_250_000.0)
        recorder.write(encode_message("samples", samples, samples.time_ns))
        if second == EVENT_S:
            recorder.write(encode_message("alert", make_alert("raised"), now_ns))
        recorder.tick(now_ns)
    recorder.close()
    for path in recorder.take_uncompacted():
        compact(path, chain)
    return sorted(tmp_path.glob("*.mcap")), chain


@pytest.mark.slow
def test_the_time_around_an_event_is_kept_to_the_sample(recorded: tuple[list[Path], SegmentChain]) -> None:
    (_, path, _), chain = recorded
    before = read_samples([path])
    trim(path, chain)
    after = read_samples([path])
    kept, before_ns = set(after.samples.time_ns.tolist()), before.samples.time_ns
    around = before_ns[before_ns <= START_NS + (EVENT_S + POST_S) * SECOND_NS]
    assert set(around.tolist()) <= kept < set(before_ns.tolist())
    assert np.array_equal(after.samples.raw, before.samples.raw[np.isin(before_ns, after.samples.time_ns)])
    assert [each.message.calibration_id for each in after.calibrations] == ["c-1"]
    assert is_trimmed(path)
    with path.open("rb") as file:
        assert list(make_reader(file, validate_crcs=True).iter_messages(["/alert"]))


@pytest.mark.slow
def test_the_chain_stays_valid_and_says_what_was_trimmed(recorded: tuple[list[Path], SegmentChain]) -> None:
    paths, chain = recorded
    trim(paths[1], chain)
    found = verify_chain([verify_file(path, None) for path in paths], [paths[0].parent])
    assert found.answer != "differs", (found.problems, [file.problems for file in found.files])
    assert "trimmed by the quota to the time around events" in found.files[1].remarks
    changed = bytearray(paths[1].read_bytes())
    changed[len(changed) // 2] ^= 1
    paths[1].write_bytes(changed)
    assert verify_chain([verify_file(path, None) for path in paths]).answer == "differs"


def test_a_trimmed_newest_segment_is_followed_by_the_next(recorded: tuple[list[Path], SegmentChain]) -> None:
    paths, chain = recorded
    paths[2].unlink()
    trim(paths[1], chain)
    found = verify_chain([verify_file(path, None) for path in paths[:2]])
    assert found.problems == ()


def test_a_segment_that_is_damaged_is_not_trimmed(recorded: tuple[list[Path], SegmentChain]) -> None:
    (_, path, _), chain = recorded
    torn = path.read_bytes()[:-200]
    path.write_bytes(torn)
    with pytest.raises(RecordingError, match="is not trimmed"):
        trim(path, chain)
    assert path.read_bytes() == torn
