"""Proof: what was changed, removed, exchanged, cut off, forged or back-dated is named; what the gateway wrote is genuine."""

import errno
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader

from gateway.cli.main import main
from gateway.incident.record_verdict import judge_recordings
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import KeyFileError, fingerprint, load_or_create_key, read_public_key
from gateway.recording.chain.chain_state import STATE_NAME, read_state, save_state
from gateway.recording.chain.chain_verification import ChainVerification, verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.missing_files import missing_of
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.format.frames import next_frame
from gateway.recording.format.salvage import open_mcap
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder, RecorderError
from tests.clocks import START_NS
from tests.gateway.recording.conftest import GATEWAY, SECOND_NS, Record, make_alert
from tests.gateway.recording.recorded_files import problems
from tests.values import present


@pytest.fixture
def segments(record: Record) -> list[Path]:
    return record(START_NS)


def verify(paths: list[Path], key: str | None = None, folders: tuple[Path, ...] = ()) -> ChainVerification:
    return verify_chain([verify_file(path, key) for path in paths], folders, key)


def key_of(folder: Path) -> str:
    return read_public_key(str(folder / "signing-key.pem.pub"))


def test_what_the_gateway_wrote_is_genuine_and_read_by_the_public_reader(segments: list[Path]) -> None:
    found = verify(segments, key_of(segments[0].parent), (segments[0].parent,))
    assert problems(found) == []
    assert [(file.segment, file.is_final) for file in found.files] == [(1, True), (2, True), (3, True)]
    with segments[1].open("rb") as file:
        records = {record.name: record.metadata for record in make_reader(file, validate_crcs=True).iter_metadata()}
    assert key_of(segments[0].parent) in records["signature"]["statement"]


def test_the_key_is_made_once_and_readable_by_its_owner_alone(segments: list[Path]) -> None:
    path = segments[0].parent / "signing-key.pem"
    assert path.stat().st_mode & 0o777 == 0o600
    key = load_or_create_key(path)
    assert key is not None
    assert key.public_hex == key_of(path.parent)
    assert len(fingerprint(key.public_hex)) == 19


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_flipped_bit_is_named(segments: list[Path], share: float) -> None:
    content = bytearray(segments[1].read_bytes())
    content[int(share * len(content))] ^= 1
    segments[1].write_bytes(content)
    found = verify(segments)
    assert found.answer == "differs"
    named = [text for file in found.files for text in file.problems]
    assert any(text.startswith(("ALTERED", "FORGED", "CUT or ALTERED")) for text in named), named
    assert not any(text.startswith("CUT:") for text in problems(found))


@pytest.mark.slow
def test_the_chunk_that_is_damaged_is_named(segments: list[Path]) -> None:
    with segments[1].open("rb") as file:
        chunk = present(make_reader(file).get_summary()).chunk_indexes[0]
    content = bytearray(segments[1].read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1
    segments[1].write_bytes(content)
    found = verify(segments)
    (altered,) = (text for text in found.files[1].problems if text.startswith("ALTERED: bytes 0 to "))
    begin, end = chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length
    assert f"; damaged: the chunk at bytes {begin} to {end} (gateway time " in altered
    unread = [text for text in found.files[1].problems if text.endswith("cannot be read")]
    assert unread == [f"ALTERED: the record at byte {begin} cannot be read"]
    assert found.problems == ()
    assert found.files[0].problems == []


@pytest.mark.slow
def test_every_flipped_bit_of_a_file_is_found_and_called_no_cut_or_removal(segments: list[Path]) -> None:
    before, changed, after = segments
    whole, others = changed.read_bytes(), [verify_file(path, None) for path in (before, after)]
    for place in range(8, len(whole), 251):
        content = bytearray(whole)
        content[place] ^= 1 << (place % 8)
        changed.write_bytes(content)
        found = verify_chain([others[0], verify_file(changed, None), others[1]], (), None)
        assert found.answer == "differs", place
        assert not any(text.startswith(("CUT:", "REMOVED", "NOT SIGNED")) for text in problems(found)), place


def test_a_removed_segment_is_named(segments: list[Path]) -> None:
    assert problems(verify([segments[0], segments[2]])) == [
        "REMOVED: segment 2 is missing in the middle; nothing signed speaks of a deletion by the gateway"
    ]


def test_a_removed_newest_segment_is_named(segments: list[Path]) -> None:
    folder = segments[0].parent
    segments[2].unlink()
    assert problems(verify(segments[:2], folders=(folder,))) == [
        "REMOVED: segment 3 is missing at the end; nothing signed speaks of a deletion by the gateway"
    ]


def test_exchanged_segments_are_named(segments: list[Path]) -> None:
    first, second = (path.read_bytes() for path in segments[:2])
    segments[0].write_bytes(second)
    segments[1].write_bytes(first)
    assert any(text.startswith("EXCHANGED") for text in problems(verify(segments)))


def test_files_that_were_renamed_or_are_there_twice_are_no_difference(segments: list[Path]) -> None:
    shutil.copy(segments[1], segments[1].with_name("Kopie von gestern.mcap"))
    renamed = [
        path.rename(path.with_name(f"{number}.mcap")) for path, number in zip(segments, (9, 10, 11), strict=True)
    ]
    found = verify([*renamed, segments[1].with_name("Kopie von gestern.mcap")])
    assert problems(found) == []
    assert any(text.endswith("are the same segment 2 twice") for text in found.remarks)
    assert any("the gateway wrote it as" in remark for file in found.files for remark in file.remarks)


@pytest.mark.slow
def test_a_segment_of_another_chain_is_named(record: Record, segments: list[Path], tmp_path: Path) -> None:
    folder = tmp_path / "other"
    folder.mkdir()
    shutil.copy(segments[0].parent / "signing-key.pem", folder)
    others = record(START_NS + 5 * SECOND_NS, folder=folder)
    shutil.copy(others[1], segments[1])
    assert any("does not follow this" in text for text in problems(verify(segments)))


@pytest.mark.slow
@pytest.mark.parametrize("cut", [1, 100, 30_000])
def test_a_cut_tail_is_named(segments: list[Path], cut: int) -> None:
    segments[2].write_bytes(segments[2].read_bytes()[:-cut])
    assert any(text.startswith(("CUT", "ALTERED")) for text in verify(segments).files[2].problems)


@pytest.mark.slow
def test_a_forged_key_is_named(record: Record, segments: list[Path], tmp_path: Path) -> None:
    forged = record(START_NS, folder=tmp_path / "forged")
    assert problems(verify(forged)) == []
    key = key_of(segments[0].parent)
    assert all("WRONG KEY" in file.problems[0] for file in verify(forged, key).files)


@pytest.mark.slow
def test_a_signature_that_was_moved_to_another_statement_is_named(segments: list[Path]) -> None:
    content = segments[0].read_bytes()
    segments[0].write_bytes(content.replace(b'"repaired":false', b'"repaired":true '))
    assert any(text.startswith("FORGED") for text in problems(verify(segments)))


@pytest.mark.slow
def test_a_clock_that_was_set_back_is_named(record: Record, segments: list[Path]) -> None:
    later = record(START_NS - 3600 * SECOND_NS, segments=1)
    found = verify(later)
    assert any("CLOCK SET BACK by 3688" in text for text in problems(found))


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [1, 25])
def test_samples_that_come_after_the_health_of_the_segment_before_are_no_difference(
    record: Record, late_s: int
) -> None:
    record(START_NS, segments=1)
    assert problems(verify(record(START_NS + (28 - late_s) * SECOND_NS + 500_000_000, segments=1))) == []


def test_a_segment_that_could_not_be_begun_takes_no_number(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = record(START_NS, segments=1)
    folder = paths[0].parent
    with monkeypatch.context() as patched:
        patched.setattr("gateway.recording.segments.segment.sync_folder", full)
        with pytest.raises(RecorderError):
            record(START_NS + 60 * SECOND_NS, segments=1)
    assert problems(verify(record(START_NS + 120 * SECOND_NS, segments=1), folders=(folder,))) == []


def full(_: Path) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.slow
def test_a_number_that_a_kill_left_unnoted_is_not_given_twice(record: Record) -> None:
    (path,) = record(START_NS, segments=1)
    state = read_state(path.parent)
    assert state is not None
    state.newest_segment = 0
    save_state(path.parent, state, load_or_create_key(path.with_name("signing-key.pem")))
    found = verify(record(START_NS + 60 * SECOND_NS, segments=1))
    assert problems(found) == []
    assert found.remarks == ()
    assert [file.segment for file in found.files] == [1, 2]


def test_a_live_file_is_verified_up_to_its_last_signature(record: Record) -> None:
    (path,) = record(START_NS, segments=1, compacted=False, closed=False)
    found = verify([path])
    assert problems(found) == []
    statement = found.files[0].statement
    assert statement is not None
    assert statement.kind == "checkpoint"
    assert statement.to_ns == START_NS + 20 * SECOND_NS
    assert "bytes at its end are not signed" in found.files[0].remarks[0]
    content = bytearray(path.read_bytes())
    content[statement.bytes - 200] ^= 1
    path.write_bytes(content)
    assert "ALTERED" in problems(verify([path]))[0]


def test_a_change_of_an_alert_is_signed_at_once(tmp_path: Path, header: RecordingHeader) -> None:
    chain = SegmentChain(tmp_path, "yard/crane-2/hook", load_or_create_key(tmp_path / "signing-key.pem"))
    recorder = Recorder(tmp_path, header, segment_s=600, fsync_s=1.0, quota_mb=100.0, chain=chain)
    path = recorder.start(START_NS)
    raised_ns = START_NS + SECOND_NS // 2
    recorder.write(encode_message("alert", replace(make_alert("raised"), time_ns=raised_ns), raised_ns))
    recorder.tick(raised_ns)
    recorder.abandon("killed")
    found = verify([path])
    assert problems(found) == []
    assert present(found.files[0].statement).to_ns == raised_ns
    assert found.files[0].remarks == ["not closed: being written, interrupted or cut off; signed to its end"]


Judge = Callable[[bytes], tuple[int, str]]


@pytest.fixture
def live(record: Record) -> Path:
    """A file that is being written, or whose gateway was killed: of 28 s, of which 20 s are signed."""
    return record(START_NS, segments=1, compacted=False, closed=False)[0]


@pytest.fixture
def judge_live(live: Path, capsys: pytest.CaptureFixture[str]) -> Judge:
    """The exit code and the text of the command of the folder, with these bytes as the live file."""

    def judge(content: bytes) -> tuple[int, str]:
        live.write_bytes(content)
        code = main(["record", "verify", str(live.parent), "--key", key_of(live.parent)])
        by_key = f" (key {fingerprint(key_of(live.parent))}, given)"
        return code, capsys.readouterr().out.rstrip().removesuffix(by_key)

    return judge


def unsigned_chunks(path: Path) -> list[tuple[int, int]]:
    """First byte and end of the chunks behind the last signature."""
    places = []
    with open_mcap(path) as file:
        while (frame := next_frame(file, path.stat().st_size)) is not None:
            if frame[1] == Opcode.CHUNK:
                places.append((file.tell() - len(frame[0]) - len(frame[2]), file.tell()))
            elif frame[1] == Opcode.METADATA and b"checkpoint" in frame[2]:
                places.clear()
    return places


UP_TO = "genuine up to 2026-01-01T00:00:20.000Z; "


def test_how_much_at_the_end_of_a_live_file_is_not_signed_is_told(live: Path, judge_live: Judge) -> None:
    whole, chunks = live.read_bytes(), unsigned_chunks(live)
    code, text = judge_live(whole)
    assert (code, text.rpartition("\n")[2]) == (3, f"{UP_TO}the last 8.0 s of {live.name} are not signed")
    first, second = chunks[:2]
    for cut in (whole[: second[1] - 1], whole[: second[1] - 100] + bytes(100)):  # in the second chunk
        code, text = judge_live(cut)
        assert (code, text.rpartition("\n")[2]) == (3, f"{UP_TO}the last 1.0 s of {live.name} are not signed")
    code, text = judge_live(whole[: first[1] - 1])
    assert text.rpartition("\n")[2] == f"{UP_TO}the last {first[1] - 1 - first[0]} bytes of {live.name} are not signed"
    code, text = judge_live(whole[: first[0]])  # as whoever takes away all that is not signed
    assert (code, "genuine up to" in text, "whether anything followed is not known" in text) == (3, True, True), text


def test_a_flipped_bit_in_what_is_not_signed_is_damage(live: Path, judge_live: Judge) -> None:
    content, chunks = bytearray(live.read_bytes()), unsigned_chunks(live)
    for begin, end in (chunks[1], chunks[-1]):
        changed = bytearray(content)
        changed[(begin + end) // 2] ^= 1
        code, text = judge_live(bytes(changed))
        assert code == 1
        assert f"NOT SIGNED, AND DAMAGED: the chunk at bytes {begin} to {end} (gateway time 2026-" in text
        assert text.endswith("NOT genuine: see above")


def test_without_a_key_too_the_end_that_is_not_signed_is_told(live: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "verify", str(live.parent)]) == 3
    said = capsys.readouterr().out.rstrip().rpartition("\n")[2]
    assert said.startswith("consistent in itself only")
    assert said.endswith(f"; signed up to 2026-01-01T00:00:20.000Z; the last 8.0 s of {live.name} are not signed")


def test_a_report_of_a_live_file_is_not_as_of_one_that_is_signed_as_a_whole(live: Path) -> None:
    verdict = judge_recordings([live], key_of(live.parent))
    assert (verdict.kind, f"the last 8.0 s of {live.name} are not signed" in verdict.line) == ("open", True), verdict
    (end,) = verdict.alterable
    assert end.to_ns - end.from_ns == pytest.approx(8e9, abs=1e8)


def test_of_a_live_file_by_name_both_are_told(live: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "verify", str(live), "--key", key_of(live.parent)]) == 3
    said = capsys.readouterr().out.rstrip().rpartition("\n")[2]
    assert "are not signed; whether others were removed, an extract cannot tell" in said


def test_a_repaired_segment_says_from_when_on_it_was_signed_afterwards(record: Record, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    record(START_NS, segments=1, compacted=False, closed=False)
    paths = record(START_NS + 60 * SECOND_NS, segments=1)
    found = verify(paths, folders=(folder,))
    assert problems(found) == []
    assert any(
        text.startswith("was cut off") and "later than 2026-01-01T00:00:20" in text for text in found.files[0].remarks
    )
    later = "segment 1 was completed at a later start of the gateway"
    assert not any(later in each for each in found.remarks)
    (folder / STATE_NAME).unlink()
    paths[-1].unlink()
    assert any(later in each for each in verify(paths[:-1], folders=(folder,)).remarks)


@pytest.mark.parametrize("has_state", [False, True])
def test_a_repaired_segment_is_the_newest_where_the_state_of_the_chain_says_so(
    record: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str], *, has_state: bool
) -> None:
    folder = tmp_path / "data"
    (path,) = record(START_NS, segments=1, compacted=False, closed=False)
    chain = SegmentChain(folder, GATEWAY, load_or_create_key(folder / "signing-key.pem"))
    chain.restore([path])
    compact(path, chain)
    if not has_state:
        (folder / STATE_NAME).unlink()
    main(["record", "verify", str(folder)])
    assert ("segment 1 was completed at a later start" in capsys.readouterr().out) == (not has_state)
    assert missing_of(open_timeline([folder])).may_go_on(1) == (not has_state)


@pytest.mark.parametrize("is_emptied", [False, True])
def test_a_repaired_segment_says_nothing_of_the_one_behind_it(
    record: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str], *, is_emptied: bool
) -> None:
    """Also where that is altered so early, or destroyed, that nothing it states can be believed."""
    folder = tmp_path / "data"
    record(START_NS, segments=1, compacted=False, closed=False)
    newest = record(START_NS + 60 * SECOND_NS, segments=1)[-1]
    content = bytearray(newest.read_bytes())
    content[200] ^= 1
    newest.write_bytes(b"" if is_emptied else content)
    assert main(["record", "verify", str(folder)]) == 1
    printed = capsys.readouterr().out
    assert ("DESTROYED" if is_emptied else "ALTERED") in printed
    assert "was completed at a later start" not in printed


@pytest.mark.slow
def test_without_the_package_segments_are_chained_and_not_signed(record: Record) -> None:
    paths = record(START_NS, signed=False)
    found = verify(paths)
    assert problems(found) == []
    assert all("not signed, chained by hashes only" in file.remarks for file in found.files)
    assert "WRONG KEY: not signed" in problems(verify(paths, "0" * 64))[0]


@pytest.mark.slow
def test_the_command_names_the_difference_and_exits_with_one(
    segments: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = segments[0].parent
    key = read_public_key(str(folder / "signing-key.pem.pub"))
    assert main(["record", "verify", str(folder), "--key", key]) == 0
    by_key = f"(key {fingerprint(key_of(folder))}, given)"
    assert f"genuine: everything is as the gateway's key signed {by_key}\n" in capsys.readouterr().out
    assert main(["record", "verify", str(folder)]) == 3
    assert "consistent in itself only" in capsys.readouterr().out
    segments[1].unlink()
    assert main(["record", "verify", str(folder), "--key", key]) == 1
    assert "REMOVED: segment 2" in capsys.readouterr().out
    assert main(["record", "verify", str(folder), "--key", "nonsense"]) == 2
    assert "--key nonsense" in capsys.readouterr().err


def test_another_key_is_told_once_for_each_file_and_called_so(
    segments: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", "verify", str(segments[0].parent), "--key", "0" * 64]) == 1
    *lines, last = capsys.readouterr().out.splitlines()
    assert sum("WRONG KEY" in line for line in lines) == len(segments)
    assert last == (
        "NOT genuine by the key that was given: either it is not that of this gateway, or another one wrote these"
    )
    verdict = judge_recordings(segments, "0" * 64)
    assert (len(verdict.problems), verdict.label) == (len(segments), "SIGNED BY ANOTHER KEY THAN THE ONE GIVEN")


def test_a_file_that_is_no_key_is_refused_with_the_remedy(tmp_path: Path) -> None:
    path = tmp_path / "signing-key.pem"
    path.write_text("no key")
    with pytest.raises(KeyFileError, match="is not an unencrypted private key"):
        load_or_create_key(path)
