"""A damaged `chain.json` never keeps a gateway from recording: it is noticed, kept aside, and rebuilt from what is signed."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.chain_state import (
    KEPT_ASIDE,
    ChainState,
    ChainStateError,
    list_aside,
    read_state,
    save_state,
)
from gateway.recording.chain.chain_verification import ChainVerification, verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.missing_files import LATER
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.statements import Statement, hash_of
from gateway.recording.format.content import segment_number
from tests.clocks import START_NS
from tests.gateway.recording.conftest import GATEWAY, SECOND_NS, Record
from tests.gateway.recording.recorded_files import problems
from tests.values import present

LATER_NS = 1000 * SECOND_NS
NEXT: dict[str, Any] = {"segment": 9, "name": "x", "n_bytes": 0, "sha256": "", "from_ns": 0, "to_ns": 0}


@pytest.fixture
def folder(record: Record) -> Path:
    """Three segments of a former run, and the state that it saved."""
    return record(START_NS)[0].parent


def restored(folder: Path) -> SegmentChain:
    chain = SegmentChain(folder, GATEWAY, load_or_create_key(folder / "signing-key.pem"))
    chain.restore(sorted(folder.glob("*.mcap"), reverse=True))
    return chain


def recorded_before(record: Record, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the statements of a version that did not sign its state."""
    with monkeypatch.context() as patched:
        patched.setitem(present(Statement.__init__.__kwdefaults__), "format", 1)
        record(START_NS, folder=folder)
    return folder


def stated(chain: SegmentChain) -> tuple[int, int, str, int]:
    """What the next statement says, and its number."""
    statement = json.loads(chain.sign("checkpoint", **NEXT)["statement"])
    return (
        chain.next_segment,
        statement["previous_segment"],
        statement["previous_sha256"],
        statement["deleted_up_to"],
    )


def verify(folder: Path) -> ChainVerification:
    return verify_chain([verify_file(path, None) for path in sorted(folder.glob("*.mcap"))], [folder])


def is_noticed_and_rebuilt(folder: Path, content: bytes, sound: tuple[int, int, str, int]) -> bool:
    """Damage the file, and compare what follows with what would have followed."""
    for path in list_aside(folder):
        path.unlink()
    (folder / "chain.json").write_bytes(content)
    chain = restored(folder)
    assert chain.loss is not None
    assert "damaged" in chain.loss
    (aside,) = list_aside(folder)
    assert aside.name in chain.loss
    saved = read_state(folder)
    assert saved is not None
    return aside.read_bytes() == content and saved.rebuilt_before == 4 and stated(chain) == sound


@pytest.mark.slow
def test_a_sound_file_is_believed(folder: Path) -> None:
    chain = restored(folder)
    assert chain.loss is None
    assert list_aside(folder) == []
    text = verify(folder).files[2].statement_text
    assert stated(chain) == (4, 3, hash_of(text), 0)


@pytest.mark.slow
def test_every_flipped_bit_and_every_cut_are_noticed_and_the_state_is_rebuilt(folder: Path) -> None:
    """What is noticed is rebuilt from the recordings alone, so that it is rebuilt after a damage in each sixteenth place."""
    path = folder / "chain.json"
    content, sound = path.read_bytes(), stated(restored(folder))
    for place in range(len(content)):
        flipped = [content[:place] + bytes([content[place] ^ 1 << bit]) + content[place + 1 :] for bit in range(8)]
        for damaged in (*flipped, content[:place]):
            path.write_bytes(damaged)
            with pytest.raises(ChainStateError, match="is damaged"):
                read_state(folder)
        if place % 16 == 0:
            for damaged in (flipped[place // 16 % 8], content[:place]):
                assert is_noticed_and_rebuilt(folder, damaged, sound), place


def with_checksum(text: str) -> bytes:
    """A file whose checksum is right, whatever it says."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f'{text[:-1]},"sha256":"{digest}"}}'.encode()


def plain(**changed: object) -> str:
    """A state as versions without a checksum wrote it."""
    sound = {"newest_segment": 3, "final_segment": 3, "final_sha256": "ab" * 32, "deleted_up_to": 0}
    return json.dumps(sound | changed, separators=(",", ":"))


CONTENTS = {
    "empty": b"",
    "zeros": bytes(400),
    "no text": bytes(range(256)),
    "UTF-16": plain().encode("utf-16"),
    "with a byte order mark": b"\xef\xbb\xbf" + plain().encode(),
    "Latin-1": plain(final_sha256="ä" * 64).encode().replace(b"\\u00e4", b"\xe4"),
    "nested": b"[" * 100_000,
    "nested inside": b'{"a":' + b"[" * 100_000,
    "null": b"null",
    "a list": b"[1,2,3]",
    "an empty object": b"{}",
    "a number as text": plain(newest_segment="3").encode(),
    "a fraction": plain(newest_segment=3.5).encode(),
    "a missing field": b'{"newest_segment":3}',
    "null in a field": plain(final_sha256=None).encode(),
    "negative": plain(newest_segment=-1).encode(),
    "too large": plain(deleted_up_to=2**31).encode(),
    "5000 digits": plain().replace(":3", ":3" + "0" * 5000).encode(),
    "no hash": plain(final_sha256="ab").encode(),
    "negative with a checksum": with_checksum(plain(final_segment=-3)),
    "too large with a checksum": with_checksum(plain(newest_segment=10**18)),
    "not finite": plain().replace(":3", ":NaN").encode(),
    "two files": plain().encode() * 2,
    "too long": b" " * 16_000_001,
}
MakeObstacle = Callable[[Path], object]


def make_full_folder(path: Path) -> None:
    (path / "inside").mkdir(parents=True)


OBSTACLES: dict[str, MakeObstacle] = {
    **{name: lambda path, content=content: path.write_bytes(content) for name, content in CONTENTS.items()},  # type: ignore[misc]
    "a folder": Path.mkdir,
    "a folder that is not empty": make_full_folder,
    "a link to nowhere": lambda path: path.symlink_to(path.parent / "nowhere"),
    "a link to itself": lambda path: path.symlink_to(path),
    "a link to a folder": lambda path: path.symlink_to(path.parent),
    "a pipe": os.mkfifo,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OBSTACLES)
def test_recording_goes_on_whatever_the_file_is(record: Record, folder: Path, name: str) -> None:
    path = folder / "chain.json"
    path.unlink()
    OBSTACLES[name](path)
    record(START_NS + LATER_NS, segments=2)
    found = verify(folder)
    assert problems(found) == []
    assert [file.segment for file in found.files] == [1, 2, 3, 4, 5]
    assert found.files[3].statement is not None
    assert found.files[3].statement.previous_sha256 == hash_of(found.files[2].statement_text)
    assert any("before segment 4 the gateway had lost chain.json" in remark for remark in found.remarks)
    assert len(list_aside(folder)) == 1
    assert read_state(folder) is not None


@pytest.mark.slow
def test_a_file_that_may_not_be_read_is_kept_and_the_state_rebuilt(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = stated(restored(folder))

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    with monkeypatch.context() as patched:
        patched.setattr("gateway.recording.chain.chain_state.read_bounded", refuse)
        chain = restored(folder)
    assert chain.loss is not None
    assert "cannot be read (Permission denied)" in chain.loss
    assert stated(chain) == sound


@pytest.mark.slow
def test_a_disk_that_takes_nothing_leaves_the_state_in_memory(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, sound = folder / "chain.json", stated(restored(folder))
    path.write_bytes(b"damaged")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gateway.recording.chain.chain_state.write_durably", full)
    monkeypatch.setattr("pathlib.Path.replace", full)
    chain = restored(folder)
    assert chain.loss is not None
    assert "cannot be kept aside (No space left on device)" in chain.loss
    assert stated(chain) == sound
    assert path.read_bytes() == b"damaged"


def test_a_file_of_the_version_before_is_believed(
    record: Record, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = recorded_before(record, tmp_path / "before", monkeypatch)
    sound = stated(restored(folder))
    (folder / "chain.json").write_text(plain(newest_segment=7, final_sha256=sound[2]))
    chain = restored(folder)
    assert chain.loss is None
    assert stated(chain) == (8, *sound[1:])
    record(START_NS + LATER_NS, segments=1)
    assert b'"sha256":' in (folder / "chain.json").read_bytes()
    assert list_aside(folder) == []


@pytest.mark.slow
def test_a_number_below_that_of_the_last_final_statement_is_not_given(tmp_path: Path) -> None:
    (tmp_path / "chain.json").write_text(plain(newest_segment=1, final_segment=9))
    assert restored(tmp_path).next_segment == 10


@pytest.mark.slow
def test_what_the_quota_deleted_is_rebuilt(record: Record) -> None:
    folder = record(START_NS, segments=8, quota_mb=0.2)[0].parent
    sound = stated(restored(folder))
    assert sound[3] > 0
    (folder / "chain.json").write_bytes(b"damaged")
    assert stated(restored(folder)) == sound
    record(START_NS + LATER_NS, segments=1)
    assert problems(verify(folder)) == []


@pytest.mark.slow
def test_after_a_kill_the_number_of_the_open_segment_is_not_given_twice(record: Record) -> None:
    folder = record(START_NS, segments=3, compacted=False, closed=False)[0].parent
    (folder / "chain.json").write_bytes(b"damaged")
    record(START_NS + LATER_NS, segments=1)
    found = verify(folder)
    assert problems(found) == []
    assert [file.segment for file in found.files] == [1, 2, 3, 4]


@pytest.mark.parametrize("damage", [b"damaged", None])
def test_without_recordings_numbers_begin_with_one(tmp_path: Path, damage: bytes | None) -> None:
    if damage is not None:
        (tmp_path / "chain.json").write_bytes(damage)
    chain = restored(tmp_path)
    assert chain.next_segment == 1
    assert chain.loss is None if damage is None else chain.loss is not None and "begin with 1" in chain.loss


def test_a_missing_file_is_named_and_the_state_rebuilt(folder: Path) -> None:
    sound = stated(restored(folder))
    (folder / "chain.json").unlink()
    chain = restored(folder)
    assert chain.loss is not None
    assert "chain.json: is missing; by the statements in the recordings, numbers go on with 4" in chain.loss
    assert stated(chain) == sound
    assert restored(folder).loss is None


def test_statements_of_another_key_give_no_hash_and_their_numbers_are_not_given_twice(folder: Path) -> None:
    (folder / "chain.json").write_bytes(b"damaged")
    for name in ("signing-key.pem", "signing-key.pem.pub"):
        (folder / name).unlink()
    assert stated(restored(folder)) == (4, 0, "", 0)


def test_without_a_key_the_state_is_rebuilt_from_hashes(record: Record, tmp_path: Path) -> None:
    record(START_NS, signed=False)
    (tmp_path / "data" / "chain.json").write_bytes(b"damaged")
    record(START_NS + LATER_NS, segments=1, signed=False)
    found = verify(tmp_path / "data")
    assert problems(found) == []
    assert [file.segment for file in found.files] == [1, 2, 3, 4]


def test_recordings_that_cannot_be_read_are_passed_over(folder: Path) -> None:
    first, second, third = sorted(folder.glob("*.mcap"))
    third.write_bytes(b"damaged")
    second.write_bytes(b"")
    (folder / "chain.json").write_bytes(b"damaged")
    assert stated(restored(folder)) == (2, 1, hash_of(verify_file(first, None).statement_text), 0)


@pytest.mark.slow
def test_a_bounded_number_of_damaged_files_is_kept_the_first_and_the_last(folder: Path) -> None:
    for number in range(KEPT_ASIDE + 4):
        (folder / "chain.json").write_text(f"damage {number}")
        loss = restored(folder).loss
        assert loss is not None
        assert ("in place of the last one" in loss) == (number >= KEPT_ASIDE)
    kept = [path.read_text() for path in list_aside(folder)]
    assert kept == [f"damage {number}" for number in (*range(KEPT_ASIDE - 1), KEPT_ASIDE + 3)]
    assert len(list(folder.glob("*damaged*"))) == KEPT_ASIDE


def test_verification_says_what_a_damaged_or_missing_file_cannot_prove(folder: Path) -> None:
    assert verify(folder).remarks == ()
    (folder / "chain.json").write_bytes(b"\xff")
    found = verify(folder)
    assert problems(found) == []
    unknown = "whether segments after 3 were removed cannot be proved"
    assert found.remarks == (f"{folder}/chain.json: is damaged: {unknown}",)
    (folder / "chain.json").unlink()
    assert verify(folder).remarks == (f"{folder}: has no chain.json: {unknown}",)


@pytest.mark.slow
def test_verification_names_a_removed_segment_after_the_state_was_rebuilt(record: Record, folder: Path) -> None:
    sorted(folder.glob("*.mcap"))[1].unlink()
    (folder / "chain.json").write_bytes(b"damaged")
    record(START_NS + LATER_NS, segments=1)
    found = verify(folder)
    assert problems(found) == [
        "REMOVED: segment 2 is missing in the middle; nothing signed speaks of a deletion by the gateway"
    ]
    assert any("before segment 4 the gateway had lost" in remark for remark in found.remarks)


@pytest.mark.slow
def test_verification_counts_an_absurd_number_of_missing_segments_at_once(folder: Path) -> None:
    absurd = ChainState(newest_segment=2**31 - 1, final_segment=2**31 - 1, final_sha256="ab" * 32)
    save_state(folder, absurd, load_or_create_key(folder / "signing-key.pem"))
    missing = "segments 4 to 2147483647 are missing at the end"
    assert problems(verify(folder)) == [f"REMOVED: {missing}; nothing signed speaks of a deletion by the gateway"]


def forged_state(folder: Path, before: bytes, *, keeps_signature: bool) -> bytes:
    """The state before the newest segment, by somebody without the key: the checksum is right."""
    numbers = json.loads(before)
    del numbers["sha256"]
    numbers["newest_segment"] = numbers["final_segment"] = 2
    numbers["final_sha256"] = hash_of(verify(folder).files[1].statement_text)
    return with_checksum(json.dumps(numbers if keeps_signature else numbers | {"signature": ""}, separators=(",", ":")))


@pytest.mark.slow
@pytest.mark.parametrize("keeps_signature", [True, False])
def test_nobody_without_the_key_makes_the_newest_segment_unheard_of(
    record: Record, folder: Path, keeps_signature: bool
) -> None:
    path = folder / "chain.json"
    path.write_bytes(forged_state(folder, path.read_bytes(), keeps_signature=keeps_signature))
    max(folder.glob("*.mcap")).unlink()
    found = verify(folder)
    assert problems(found) == [f"FORGED: {path} is not signed with the key of the recordings"]
    assert any("whether segments after 2 were removed cannot be proved" in remark for remark in found.remarks)
    chain = restored(folder)
    assert chain.loss is not None
    assert "is not signed with the gateway's key; it is kept as chain.json.damaged-1" in chain.loss
    record(START_NS + LATER_NS, segments=1)
    assert any("before segment 3 the gateway had lost chain.json" in remark for remark in verify(folder).remarks)


@pytest.mark.slow
@pytest.mark.parametrize("forger_signs", [True, False])
def test_a_recording_of_another_key_vouches_for_no_state(
    record: Record, folder: Path, tmp_path: Path, forger_signs: bool
) -> None:
    """The newest segment is removed, and one by the forger's key is the newest file."""
    forger = record(START_NS + LATER_NS, folder=tmp_path / "forger", segments=1)[0]
    path = folder / "chain.json"
    path.write_bytes(forged_state(folder, path.read_bytes(), keeps_signature=False))
    max(folder.glob("*.mcap")).unlink()
    shutil.copy(forger, folder)
    if forger_signs:
        save_state(folder, present(read_state(folder)), load_or_create_key(forger.with_name("signing-key.pem")))
    chain = restored(folder)
    assert "is not signed with the gateway's key" in present(chain.loss)
    assert json.loads(chain.sign("checkpoint", **NEXT)["statement"])["rebuilt_before"] > 0


@pytest.mark.slow
def test_a_state_that_is_not_signed_proves_nothing_of_the_end(
    record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = recorded_before(record, tmp_path / "before", monkeypatch)
    state = read_state(folder)
    assert state is not None
    save_state(folder, state)
    found = verify(folder)
    assert problems(found) == []
    assert found.untold == LATER
    assert [remark for remark in found.remarks if "is not signed" in remark] == [
        f"{folder / 'chain.json'}: is not signed: whether segments after 3 were removed cannot be proved"
    ]


def test_the_reason_names_the_file_in_one_line(tmp_path: Path) -> None:
    assert read_state(tmp_path) is None
    for content in CONTENTS.values():
        (tmp_path / "chain.json").write_bytes(content)
        with pytest.raises(ChainStateError, match=r"chain\.json: (is damaged|cannot be read)[^\n]*\Z"):
            read_state(tmp_path)


@pytest.mark.parametrize(
    ("text", "number"),
    [("12", 12), ("2147483647", 2**31 - 1), ("2147483648", 0), ("9" * 5000, 0), ("-1", 0), ("", 0), ("x", 0), ("²", 0)],
)
def test_only_a_plausible_number_of_a_segment_is_believed(text: str, number: int) -> None:
    assert segment_number({"segment": text}) == number
