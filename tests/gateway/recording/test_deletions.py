"""Deletions: what the gateway deletes it signs with the reason, and what somebody else took away is told apart from it."""

import hashlib
import io
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gateway.cli.main import main
from gateway.pki.signing_key import load_or_create_key, read_public_key
from gateway.recording.chain.chain_state import read_state, save_state
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.statements import MAX_RUNS, SIGNATURE, parse_deletions, parse_statement
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.recording.reading.recording_file import read_index
from gateway.recording.segments.copying import RecordCopier
from gateway.recording.segments.events import marker_path
from tests.clocks import START_NS
from tests.gateway.recording.conftest import SECOND_NS, Record
from tests.gateway.recording.recorded_files import segments

LATER_NS = 1000 * SECOND_NS
QUOTA_MB = 0.2
Capture = pytest.CaptureFixture[str]


def verify(capsys: Capture, *paths: Path) -> tuple[int, str, dict[str, Any]]:
    """The exit code, the text and the JSON of the command, with the key."""
    folder = paths[0].parent if paths[0].is_file() else paths[0]
    key = read_public_key(str(folder / "signing-key.pem.pub"))
    arguments = ["record", "verify", *map(str, paths), "--key", key]
    capsys.readouterr()
    code = main(arguments)
    text = capsys.readouterr().out
    main([*arguments, "--json", "-"])
    return code, text, json.loads(capsys.readouterr().out)


@pytest.fixture
def folder(record: Record) -> Path:
    """A folder of which the quota has deleted the oldest of eight segments."""
    return record(START_NS, segments=8, quota_mb=QUOTA_MB)[0].parent


@pytest.mark.slow
def test_first_segments_that_were_taken_away_are_missed(record: Record, capsys: Capture) -> None:
    first, second, third, *_ = record(START_NS, segments=4)
    first.unlink()
    second.unlink()
    code, text, result = verify(capsys, third.parent)
    assert code == 1
    assert "the files are segments 3 to 4\n" in text
    assert "REMOVED: segments 1 to 2 are missing at the beginning; nothing signed speaks of a deletion" in text
    assert (result["first_segment"], result["last_segment"]) == (3, 4)
    assert result["missing"] == [{"first": 1, "last": 2, "place": "beginning", "reason": "removed", "quota_mb": None}]


@pytest.mark.slow
def test_files_that_are_named_may_begin_anywhere(record: Record, capsys: Capture) -> None:
    paths = record(START_NS, segments=4)
    code, text, result = verify(capsys, *paths[2:])
    assert (code, result["answer"]) == (3, "extract")
    assert "the files are segments 3 to 4\n" in text
    assert result["missing"] == []


@pytest.mark.slow
def test_what_the_quota_deleted_is_signed_with_its_reason(folder: Path, capsys: Capture) -> None:
    code, text, result = verify(capsys, folder)
    first = result["first_segment"]
    assert (code, result["problems"]) == (0, [])
    assert first > 2
    assert (
        f"segments 1 to {first - 1} are missing at the beginning: deleted by the quota of 0.2 MB, as the gateway"
        in text
    )
    assert result["missing"] == [
        {"first": 1, "last": first - 1, "place": "beginning", "reason": "quota", "quota_mb": 0.2}
    ]


@pytest.mark.slow
def test_a_segment_taken_away_after_those_of_the_quota_is_told_apart(folder: Path, capsys: Capture) -> None:
    oldest, *_ = segments(folder)
    first = verify(capsys, folder)[2]["first_segment"]
    oldest.unlink()
    code, text, result = verify(capsys, folder)
    assert code == 1
    assert f"segments 1 to {first - 1} are missing at the beginning: deleted by the quota" in text
    assert f"REMOVED: segment {first} is missing at the beginning;" in text
    assert [each["reason"] for each in result["missing"]] == ["quota", "removed"]


@pytest.mark.slow
def test_a_segment_that_the_quota_had_kept_is_missed(record: Record, capsys: Capture) -> None:
    """The largest number that the quota has deleted is beyond that of a segment with an event."""
    eventful = record(START_NS, segments=2)[0]
    folder = eventful.parent
    marker_path(eventful).touch()
    record(START_NS + LATER_NS, segments=8, quota_mb=QUOTA_MB)
    code, text, result = verify(capsys, folder)
    assert (code, result["first_segment"]) == (0, 1)
    assert "are missing in the middle: deleted by the quota" in text
    eventful.unlink()
    code, text, _ = verify(capsys, folder)
    assert code == 1
    assert "REMOVED: segment 1 is missing at the beginning" in text


@pytest.mark.slow
def test_deletions_of_a_changed_quota_stand_apart(record: Record, folder: Path, capsys: Capture) -> None:
    first = verify(capsys, folder)[2]["first_segment"]
    record(START_NS + LATER_NS, segments=1, quota_mb=0.1)
    code, text, result = verify(capsys, folder)
    assert code == 0
    assert [(each["first"], each["quota_mb"]) for each in result["missing"]] == [(1, 0.2), (first, 0.1)]
    assert "deleted by the quota of 0.1 MB" in text


def test_a_segment_without_a_message_is_as_it_was_signed(record: Record, capsys: Capture) -> None:
    """A gateway that is stopped before its first sample, or a segment that a tiny quota ends at once."""
    folder = record(START_NS, segments=0, compacted=False)[0].parent
    code, _, result = verify(capsys, folder)
    assert (code, result["problems"]) == (0, [])


@pytest.mark.slow
def test_a_deletion_is_stated_before_the_next_sync(record: Record, capsys: Capture) -> None:
    folder = record(START_NS, segments=8, quota_mb=QUOTA_MB, compacted=False, closed=False)[0].parent
    (folder / "chain.json").unlink()
    code, text, result = verify(capsys, folder)
    assert (code, result["problems"]) == (3, [])
    assert "deleted by the quota" in text


@pytest.mark.slow
def test_a_deletion_that_no_segment_states_yet_is_in_the_saved_state(folder: Path, capsys: Capture) -> None:
    oldest, *_ = segments(folder)
    chain = SegmentChain(folder, "yard/crane-2/hook", load_or_create_key(folder / "signing-key.pem"))
    chain.restore(segments(folder)[::-1])
    chain.note_deletion(chain.number_of(oldest), "disk", 16000.0)
    oldest.unlink()
    code, text, _ = verify(capsys, folder)
    assert code == 0
    assert "deleted for want of space on the disk, with a quota of 16000 MB, as the gateway has signed" in text


@pytest.mark.slow
def test_recording_goes_on_where_signatures_can_no_longer_be_checked(
    record: Record, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setitem(sys.modules, "cryptography.exceptions", None)
        paths = record(START_NS + LATER_NS, segments=1, signed=False)
    assert b'"quota_mb":0.2' in paths[-1].read_bytes()


@pytest.mark.slow
def test_a_deletion_that_was_written_into_the_saved_state_is_never_believed(record: Record, capsys: Capture) -> None:
    """The checksum is right, the signatures cannot be; the gateway does not sign it at its next start either."""
    first, *_ = record(START_NS, segments=4)
    folder = first.parent
    state = read_state(folder)
    assert state is not None
    deleted = '[{"reason":"quota","quota_mb":100.0,"segments":[[1,1]]}]'
    state.deletions["statement"] = state.deletions["statement"].replace('"deleted":[]', f'"deleted":{deleted}')
    state.deleted_up_to = 4
    save_state(folder, state)
    first.unlink()
    code, text, _ = verify(capsys, folder)
    assert code == 1
    assert "chain.json is not signed with the key of the recordings" in text
    record(START_NS + LATER_NS, segments=1)
    code, text, _ = verify(capsys, folder)
    assert code == 1
    assert "REMOVED: segment 1 is missing at the beginning" in text


@pytest.mark.slow
def test_the_statement_stays_short_however_many_segments_are_kept_in_between(folder: Path) -> None:
    """Every other segment has an event, for years; of the oldest ones it is not stated which were deleted."""
    chain = SegmentChain(folder, "yard/crane-2/hook", load_or_create_key(folder / "signing-key.pem"))
    chain.restore(segments(folder)[::-1])
    for number in range(11, 11 + 2 * (MAX_RUNS + 50), 2):
        chain.note_deletion(number, "quota", QUOTA_MB)
    statement = parse_deletions(chain.deletions)
    assert statement is not None
    assert len(chain.deletions["statement"]) < 16_000
    assert sum(len(each.segments) for each in statement.deleted) == MAX_RUNS
    assert 100 <= statement.unstated_up_to <= 113


@pytest.mark.slow
@pytest.mark.parametrize("damage", [b"damaged", None])
def test_what_was_deleted_is_known_without_the_saved_state(
    record: Record, folder: Path, capsys: Capture, damage: bytes | None
) -> None:
    before = verify(capsys, folder)[2]["missing"]
    (folder / "chain.json").unlink() if damage is None else (folder / "chain.json").write_bytes(damage)
    assert verify(capsys, folder)[2]["missing"] == before
    record(START_NS + LATER_NS, segments=1)
    code, _, result = verify(capsys, folder)
    assert (code, result["missing"]) == (0, before)


@pytest.mark.slow
def test_a_statement_about_deletions_that_was_changed_is_named(folder: Path, capsys: Capture) -> None:
    newest = segments(folder)[-1]
    content = newest.read_bytes()
    assert content.count(b'"segments":[[1,') == content.count(b'"quota_mb":0.2') > 0
    newest.write_bytes(content.replace(b'"quota_mb":0.2', b'"quota_mb":9.2'))
    code, text, _ = verify(capsys, folder)
    assert code == 1
    assert "ALTERED: bytes" in text


def as_the_version_before_wrote_it(path: Path) -> None:
    """Write a compacted segment again without a statement about deletions, signed with the same key."""
    key = load_or_create_key(path.parent / "signing-key.pem")
    statement = parse_statement(read_index(path).metadata[SIGNATURE]["statement"])
    assert key is not None
    assert statement is not None
    copied = io.BytesIO()
    writer = McapWriter(copied, DENSE)
    with open_mcap(path) as source:
        RecordCopier(writer, SalvageReport()).copy(read_records(source, SalvageReport()))
    writer.flush()
    sha256 = hashlib.sha256(copied.getvalue()).hexdigest()
    text = replace(statement, bytes=copied.tell(), sha256=sha256).text()
    writer.add_metadata(SIGNATURE, {"statement": text, "signature": key.sign(text)})
    writer.finish()
    path.write_bytes(copied.getvalue())


@pytest.mark.slow
def test_recordings_of_a_version_before_are_judged_by_what_they_state(
    record: Record, folder: Path, capsys: Capture
) -> None:
    """They state the largest number that the quota has deleted; the hashes of those before no longer match here."""
    newest = segments(folder)[-1]
    for path in segments(folder)[:-1]:
        path.unlink()
    as_the_version_before_wrote_it(newest)
    statement = parse_statement(read_index(newest).metadata[SIGNATURE]["statement"])
    state = read_state(folder)
    assert statement is not None
    assert state is not None
    deleted, first = statement.deleted_up_to, statement.segment
    state.deletions = {}
    save_state(folder, state, load_or_create_key(folder / "signing-key.pem"))
    unstated = f"the quota had deleted segments up to {deleted}, and which ones is not stated"
    for _ in range(2):  # a start of this version changes nothing
        code, text, result = verify(capsys, folder)
        assert code == 1
        assert f"segments 1 to {deleted} are missing at the beginning; nothing signed says why: {unstated}" in text
        assert result["missing"] == [
            {"first": 1, "last": deleted, "place": "beginning", "reason": "not_stated", "quota_mb": None},
            {"first": deleted + 1, "last": first - 1, "place": "beginning", "reason": "removed", "quota_mb": None},
        ]
        record(START_NS + LATER_NS, segments=1)
