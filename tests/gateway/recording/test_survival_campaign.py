"""The survival campaign in its short form; `python -m tests.benchmarks.survival` runs all of it."""

from pathlib import Path

import pytest

from gateway.recording.format import mcap_writer
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.copying import recover
from tests.benchmarks.survival import campaign, content, record, specimen


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
