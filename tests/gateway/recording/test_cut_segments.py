"""A closed segment the end of which is lost stays proved up to a chunk before, and whoever knows that it was closed says so."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import ChunkIndex

from devices.block import SampleBlock
from gateway.packing import pack
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import load_or_create_key, read_public_key
from gateway.recording.chain.chain_state import STATE_NAME
from gateway.recording.chain.chain_verification import ChainVerification, verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.recording.conftest import DEVICE, GATEWAY, HEADER, SECOND_NS, Record
from tests.gateway.recording.recorded_files import problems
from tests.values import present

SECONDS, PER_SECOND = 50, 4000


@pytest.fixture
def segment(tmp_path: Path) -> Path:
    """A compacted segment of noise, in some chunks."""
    chain = SegmentChain(tmp_path, GATEWAY, load_or_create_key(tmp_path / "signing-key.pem"))
    recorder = Recorder(tmp_path, HEADER, segment_s=600, fsync_s=1.0, quota_mb=100, chain=chain)
    recorder.set_device(DEVICE, START_NS)
    recorder.start(START_NS)
    rng = np.random.default_rng(3)
    for second in range(SECONDS):
        now_ns = START_NS + second * SECOND_NS
        time_ns = now_ns + np.arange(PER_SECOND) * (SECOND_NS // PER_SECOND)
        raw = rng.normal(0, 143, (PER_SECOND, 3)).astype(np.int32)
        samples = pack(
            SampleBlock(time_ns, raw, 25.5), time_ns=now_ns, clock="synchronised", sequence=second, calibration_id="c-1"
        )
        recorder.write(encode_message("samples", samples, now_ns))
        recorder.tick(now_ns)
    recorder.close()
    (path,) = recorder.take_uncompacted()
    compact(path, chain)
    return path


def chunks(path: Path) -> list[ChunkIndex]:
    with path.open("rb") as file:
        return present(make_reader(file).get_summary()).chunk_indexes


def verify(path: Path) -> ChainVerification:
    key = read_public_key(str(path.parent / "signing-key.pem.pub"))
    return verify_chain([verify_file(path, key)], [path.parent], key)


def test_what_is_left_of_a_closed_segment_is_signed_up_to_a_chunk(segment: Path) -> None:
    assert verify(segment).answer == "genuine"
    *_, before_last, last = chunks(segment)
    segment.write_bytes(segment.read_bytes()[: last.chunk_start_offset + last.chunk_length // 2])
    (found,) = verify(segment).files
    assert present(found.statement).to_ns == before_last.message_end_time
    assert found.unsigned_bytes > 0
    assert problems(verify(segment)) == [
        f"CUT: {segment.name} is not whole: {STATE_NAME} states that it was signed as a whole"
    ]


def test_without_the_saved_state_a_cut_segment_is_genuine_as_far_as_it_is_signed(segment: Path) -> None:
    last = chunks(segment)[-1]
    segment.write_bytes(segment.read_bytes()[: last.chunk_start_offset])
    (segment.parent / STATE_NAME).unlink()
    found = verify(segment)
    assert (found.answer, found.problems) == ("unsigned_end", ())
    assert "has no signature of the whole of it" in found.conclusion


def test_a_segment_that_was_signed_anew_is_named_whatever_the_next_one_is_called(record: Record) -> None:
    first, second = record(START_NS, segments=2)
    chain = SegmentChain(first.parent, GATEWAY, load_or_create_key(first.parent / "signing-key.pem"))
    chain.restore([second, first])
    compact(first, chain)
    later = second.rename(second.with_name("{0[x]}.mcap"))
    found = verify_chain([verify_file(path, None) for path in (first, later)])
    assert problems(found) == [f"EXCHANGED: {later.name} does not follow this {first.name}, but another one"]


def test_every_damaged_chunk_is_named_and_where_the_first_one_is(segment: Path) -> None:
    content = bytearray(segment.read_bytes())
    first, *_, last = found = chunks(segment)
    assert len(found) > 2
    for chunk in (first, last):
        content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1
    segment.write_bytes(content)
    (altered,) = (text for text in verify(segment).files[0].problems if "are not what the gateway signed" in text)
    assert altered.startswith("ALTERED: bytes 0 to ")
    assert int(altered.split()[4]) < found[1].chunk_start_offset
    for chunk in (first, last):
        begin = chunk.chunk_start_offset
        assert f"the chunk at bytes {begin} to {begin + chunk.chunk_length} (" in altered
