"""The outbox: what was appended is read again, whatever ends the writing, and in order behind any position."""

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway import outbox as files
from gateway.outbox import (
    FILE_CHANGES,
    KEPT_FILES,
    MAX_DIGITS,
    MAX_OUTBOX_FILES,
    AlertOutbox,
    Position,
    StoredChange,
    encode_line,
    parse_line,
    readable_size,
)


def change(number: int, boot_id: str = "a") -> StoredChange:
    return StoredChange(boot_id, number, b'{"alert_number":%d,"text":"swing trip"}' % number)


def numbers(outbox: AlertOutbox, position: Position, unstored: list[StoredChange] | None = None) -> list[int]:
    """All changes behind a position, page by page."""
    found: list[StoredChange] = []
    while True:
        page = outbox.page_after(position, unstored or [], most_bytes=2000)
        found += page.changes
        if not page.more:
            return [each.number for each in found]
        position = Position(found[-1].number, found[-1].boot_id)


def filled(folder: Path, count: int, boot_id: str = "a", first: int = 1) -> AlertOutbox:
    outbox = AlertOutbox(folder)
    outbox.open()
    for number in range(first, first + count):
        outbox.append([change(number, boot_id)])
    return outbox


@pytest.mark.slow
@given(st.text(), st.integers(0, 10**MAX_DIGITS - 1), st.binary())
def test_a_line_is_read_again_and_any_flipped_bit_is_noticed(boot_id: str, number: int, payload: bytes) -> None:
    known = StoredChange(boot_id, number, payload)
    try:
        line = encode_line(known)
    except ValueError:
        return
    assert parse_line(line.removesuffix(b"\n")) == known
    for place in range(0, len(line) - 1, 7):
        damaged = bytearray(line[:-1])
        damaged[place] ^= 4
        assert parse_line(bytes(damaged)) is None


@pytest.mark.slow
def test_after_a_kill_at_any_byte_every_complete_change_is_there_and_numbers_continue(tmp_path: Path) -> None:
    content = b"".join(encode_line(change(number)) for number in (1, 2, 3))
    for size in range(len(content) + 1):
        folder = tmp_path / str(size)
        folder.mkdir()
        (folder / files.FIRST_NAME).write_bytes(content[:size])
        complete = content[:size].count(b"\n")
        outbox = AlertOutbox(folder)
        assert outbox.open() == complete
        outbox.append([change(complete + 1, "b")])
        assert numbers(outbox, Position(0)) == list(range(1, complete + 2))
        outbox.close()


def test_zeros_behind_the_last_change_are_cut_off(tmp_path: Path) -> None:
    line = encode_line(change(1))
    for torn in (b"\0" * 40, b"\0" * 40 + b"\n", b"junk\n\n", b"\n"):
        assert readable_size(line + torn) == len(line)
    assert readable_size(b"junk\n") == 0


def test_a_damaged_line_costs_itself_alone(tmp_path: Path) -> None:
    outbox = filled(tmp_path, 5)
    path = tmp_path / files.FIRST_NAME
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert numbers(outbox, Position(0)) == [1, 2, 4, 5]


@pytest.mark.slow
def test_pages_follow_each_other_through_all_files(tmp_path: Path) -> None:
    outbox = filled(tmp_path, 2 * FILE_CHANGES + 10)
    assert len(list(tmp_path.iterdir())) == 3
    assert numbers(outbox, Position(0)) == list(range(1, 2 * FILE_CHANGES + 11))
    assert numbers(outbox, Position(FILE_CHANGES, "a")) == list(range(FILE_CHANGES + 1, 2 * FILE_CHANGES + 11))
    assert numbers(outbox, Position(2 * FILE_CHANGES + 10, "a")) == []
    outbox.close()
    assert AlertOutbox(tmp_path).open() == 2 * FILE_CHANGES + 10


@pytest.mark.slow
def test_the_newest_changes_are_found_across_files(tmp_path: Path) -> None:
    assert AlertOutbox(tmp_path).newest(3) == []
    outbox = filled(tmp_path, FILE_CHANGES + 2)
    changes = [change(number) for number in range(1, FILE_CHANGES + 3)]
    assert outbox.newest(5) == changes[-5:]
    assert outbox.newest(len(changes) + 1) == changes
    outbox.close()


def test_changes_that_are_not_stored_follow_those_that_are(tmp_path: Path) -> None:
    outbox = filled(tmp_path, 3)
    waiting = [change(4), change(5)]
    assert numbers(outbox, Position(2, "a"), waiting) == [3, 4, 5]
    assert numbers(outbox, Position(4, "a"), waiting) == [5]


@pytest.mark.slow
def test_the_number_of_files_is_bounded_and_what_was_deleted_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "FILE_CHANGES", 2)
    outbox = filled(tmp_path, 2 * MAX_OUTBOX_FILES + 9)
    assert len(list(tmp_path.iterdir())) == MAX_OUTBOX_FILES
    page = outbox.page_after(Position(3, "a"))
    assert not page.complete
    assert page.changes[0].number > 4
    assert not outbox.page_after(Position(3)).complete
    assert outbox.page_after(Position(page.changes[0].number - 1)).complete


def test_old_files_are_deleted_but_the_newest_are_kept_at_any_age(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "FILE_CHANGES", 2)
    outbox = filled(tmp_path, 20)
    for path in tmp_path.iterdir():
        os.utime(path, (0, 0))
    outbox.append([change(21)])
    assert len(list(tmp_path.iterdir())) == KEPT_FILES


def test_a_number_that_occurs_in_two_boots_is_two_changes(tmp_path: Path) -> None:
    """The disk failed in boot b, whose changes 3 and 4 were sent and not stored; boot c began with 3 again."""
    outbox = filled(tmp_path, 2, "a")
    outbox.append([change(3, "c")])
    assert numbers(outbox, Position(2, "a")) == [3]
    page = outbox.page_after(Position(4, "b"))
    assert (page.complete, [each.number for each in page.changes]) == (False, [1, 2, 3])


def test_an_outbox_on_a_new_disk_knows_that_it_is_not_complete(tmp_path: Path) -> None:
    page = filled(tmp_path, 5, "z").page_after(Position(3, "a"))
    assert (page.complete, len(page.changes)) == (False, 5)


def test_a_disk_that_fails_in_the_middle_of_a_line_leaves_no_half_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outbox = filled(tmp_path, 2)

    def full(descriptor: int, content: bytes) -> int:
        os.pwrite(descriptor, content[:9], 0)  # append mode: at the end
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as failing:
        failing.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space"):
            outbox.append([change(3)])
    outbox.append([change(3), change(4)])
    assert numbers(outbox, Position(0)) == [1, 2, 3, 4]
    assert (tmp_path / files.FIRST_NAME).read_bytes() == b"".join(encode_line(change(n)) for n in (1, 2, 3, 4))


@pytest.mark.slow
@given(
    boots=st.lists(st.integers(0, 9), min_size=1, max_size=5),
    taken=st.integers(0, 40),
)
def test_behind_any_change_follow_exactly_those_after_it(
    tmp_path_factory: pytest.TempPathFactory, boots: list[int], taken: int
) -> None:
    outbox = AlertOutbox(tmp_path_factory.mktemp("outbox"))
    written: list[tuple[str, int]] = []
    for boot, count in enumerate(boots):
        last = outbox.open()
        for number in range(last + 1, last + 1 + count):
            outbox.append([change(number, f"b{boot}")])
            written.append((f"b{boot}", number))
        outbox.close()
    have = written[: min(taken, len(written))]
    position = Position(have[-1][1], have[-1][0]) if have else Position(0)
    page = outbox.page_after(position, most_bytes=10**6)
    assert page.complete
    assert [(each.boot_id, each.number) for each in page.changes] == written[len(have) :]
