"""What is believed of a recording is what was signed: nothing behind the signature counts, and no earlier copy passes."""

import json
from pathlib import Path
from typing import Any

import pytest

from devices.errors import RecordingError
from gateway.cli.main import main
from gateway.pki.signing_key import load_or_create_key, read_public_key
from gateway.recording.chain.chain_state import STATE_NAME, read_state, save_state
from gateway.recording.chain.chain_verification import ChainVerification, verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.compaction import compact
from tests.clocks import START_NS
from tests.gateway.recording import forgery
from tests.gateway.recording.conftest import GATEWAY, SECOND_NS, Record


@pytest.fixture
def segments(record: Record) -> list[Path]:
    return record(START_NS, segments=5)


def verify(paths: list[Path]) -> ChainVerification:
    folder = paths[0].parent
    key = read_public_key(str(folder / "signing-key.pem.pub"))
    found = [verify_file(path, key) for path in sorted(folder.glob("*.mcap"))]
    return verify_chain(found, [folder], key)


def problems(found: ChainVerification) -> str:
    return "\n".join([*(text for file in found.files for text in file.problems), *found.problems])


def command(folder: Path, *verb: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    code = main(["record", *verb, str(folder), "--json", "-"])
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return code, answer


@pytest.mark.slow
def test_a_removed_segment_is_missed_though_others_are_numbered_anew_behind_the_signature(
    segments: list[Path],
) -> None:
    segments[2].unlink()
    for number, path in ((3, segments[3]), (4, segments[4])):
        forgery.with_end(path, forgery.renumbered(number))
    state = read_state(segments[0].parent)
    assert state is not None
    state.final_segment = state.newest_segment = 4
    save_state(segments[0].parent, state)
    found = verify(segments)
    assert "REMOVED: segment 3 is missing in the middle" in problems(found)
    assert "ALTERED: what follows the data" in problems(found)
    assert [file.segment for file in found.files] == [1, 2, 4, 5]


@pytest.mark.slow
def test_a_summary_behind_the_signature_is_named_and_not_believed(
    segments: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    forgery.with_end(segments[1], forgery.summarised(segments[1]))
    assert "ALTERED: what follows the data" in problems(verify(segments))
    _, info = command(segments[1], "info", capsys=capsys)
    assert info["log_count"] != forgery.FORGED_LOG_COUNT


@pytest.mark.slow
def test_a_time_in_the_statistics_is_named_and_not_believed(
    segments: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    _, before = command(segments[1].parent, "info", capsys=capsys)
    forgery.with_end(segments[1], forgery.retimed(-(10**15)))
    assert "ALTERED: what follows the data" in problems(verify(segments))
    _, after = command(segments[1].parent, "info", capsys=capsys)
    assert (after["from_utc_ns"], after["samples"]) == (before["from_utc_ns"], before["samples"])


@pytest.mark.slow
def test_another_name_of_a_channel_in_the_index_is_named_and_not_believed(segments: list[Path]) -> None:
    topics = {message.topic for message in open_recording(segments[1]).messages()}
    forgery.with_end(segments[1], forgery.rechannelled)
    assert "ALTERED: what follows the data" in problems(verify(segments))
    assert {message.topic for message in open_recording(segments[1]).messages()} == topics


@pytest.mark.slow
def test_a_finished_segment_that_was_replaced_by_its_beginning_is_named(record: Record) -> None:
    record(START_NS, segments=2)
    (third,) = record(START_NS + 60 * SECOND_NS, segments=1, compacted=False)[2:]
    early = forgery.cut_behind_first_signature(third.read_bytes())
    paths = record(START_NS + 90 * SECOND_NS, segments=2)  # the third is signed whole, and the others follow it
    assert problems(verify(paths)) == ""
    third.write_bytes(forgery.with_chunk(early, START_NS + 61 * SECOND_NS))
    assert "is not whole: " in problems(verify(paths))
    third.write_bytes(early)
    assert "is not whole: " in problems(verify(paths))


@pytest.mark.slow
def test_unsigned_bytes_of_a_segment_that_others_follow_are_a_difference(record: Record) -> None:
    (first,) = record(START_NS, segments=1, compacted=False, closed=False)
    live = first.read_bytes()
    paths = record(START_NS + 60 * SECOND_NS, segments=1, compacted=False)
    first.write_bytes(live)
    paths[1].write_bytes(forgery.cut_behind_first_signature(paths[1].read_bytes()))
    assert f"is not whole: {STATE_NAME} states" in problems(verify(paths))
    (first.parent / STATE_NAME).unlink()
    assert "are not signed, though segment 2 follows" in problems(verify(paths))


def test_the_newest_segment_that_was_cut_back_to_a_signature_and_closed_anew_is_named(record: Record) -> None:
    """Every byte of it is signed, every index right."""
    (path,) = record(START_NS, segments=1, compacted=False)
    content = path.read_bytes()
    path.write_bytes(forgery.closed(content[: forgery.data_end(content)]))
    assert problems(verify([path])) == ""
    path.write_bytes(forgery.closed(forgery.cut_behind_last_checkpoint(content)))
    assert problems(verify([path])) == (
        "CUT: it was closed behind a signature that is not the gateway's last; what followed is missing"
    )


def test_content_of_a_closed_segment_behind_its_last_signature_is_named(record: Record) -> None:
    (path,) = record(START_NS, segments=1, compacted=False)
    content = path.read_bytes()
    end = forgery.data_end(content)
    added = forgery.with_chunk(content[:end], START_NS + SECOND_NS)
    path.write_bytes(added + content[end:])
    assert "ADDED: " in problems(verify([path]))


def test_what_differs_from_its_checkpoints_is_never_signed_as_a_whole(record: Record) -> None:
    (path,) = record(START_NS, segments=1, compacted=False)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    is_refused(path, path.parent / "signing-key.pem")


@pytest.mark.slow
@pytest.mark.parametrize("signed", [True, False])
def test_what_another_key_or_none_has_signed_is_never_signed_as_a_whole(
    record: Record, tmp_path: Path, signed: bool
) -> None:
    (path,) = record(START_NS, segments=1, compacted=False, signed=signed)
    is_refused(path, tmp_path / "another-key.pem")


def is_refused(path: Path, key: Path) -> None:
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="stays as it is"):
        compact(path, SegmentChain(path.parent, GATEWAY, load_or_create_key(key)))
    assert path.read_bytes() == before
