"""Files that are whole or not there."""

import grp
import os
from pathlib import Path
from typing import Any

import pytest

from gateway.atomic_io import COMMAND_GROUP, append_line, write_durably, write_private


def test_a_file_is_replaced_in_folders_that_are_made(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "c.json"
    write_durably(path, b"one")
    write_durably(path, b"two")
    assert path.read_bytes() == b"two"
    assert [entry.name for entry in path.parent.iterdir()] == ["c.json"]


@pytest.mark.parametrize("call", ["write", "fsync", "replace"])
def test_a_failure_leaves_only_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    path = tmp_path / "c.json"
    write_durably(path, b"old")

    def refuse(*_arguments: Any, **_options: Any) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, call, refuse)
        with pytest.raises(OSError, match="No space left"):
            write_durably(path, b"new")
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["c.json"]


def test_lines_are_appended_after_an_incomplete_one(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    append_line(path, b"one")
    with path.open("ab") as file:
        file.write(b"tor")
    append_line(path, b"two")
    assert path.read_bytes() == b"one\ntor\ntwo\n"


def test_a_link_in_place_of_the_incomplete_file_is_not_followed(tmp_path: Path) -> None:
    victim, path = tmp_path / "victim", tmp_path / "folder" / "c.json"
    victim.write_bytes(b"whole")
    path.parent.mkdir()
    path.with_name(".c.json.part").symlink_to(victim)
    with pytest.raises(OSError, match="symbolic links"):
        write_durably(path, b"new")
    assert victim.read_bytes() == b"whole"
    write_durably(path, b"new")
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("durable", [True, False])
def test_a_link_in_place_of_a_log_is_not_followed(tmp_path: Path, durable: bool) -> None:
    victim, path = tmp_path / "victim", tmp_path / "security.jsonl"
    victim.write_bytes(b"precious")
    path.symlink_to(victim)
    with pytest.raises(OSError, match="symbolic links"):
        append_line(path, b"{}", durable=durable)
    assert victim.read_bytes() == b"precious"


def test_a_secret_of_a_group_goes_to_those_who_may_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    entry = grp.getgrgid(os.getegid())
    monkeypatch.setattr("gateway.atomic_io.grp.getgrnam", lambda name: entry if name == COMMAND_GROUP else None)
    monkeypatch.setattr("gateway.atomic_io.os.fchown", lambda _, user, group: given.append(group))
    for name, mode in (("token", 0o640), ("key", 0o600), ("public", 0o644)):
        write_private(tmp_path / name, b"x", mode)
        assert (tmp_path / name).stat().st_mode & 0o777 == mode
    assert given == [entry.gr_gid]


def test_a_secret_that_cannot_be_given_to_them_is_its_owners_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: int) -> None:
        raise PermissionError

    monkeypatch.setattr("gateway.atomic_io.grp.getgrnam", lambda _: grp.getgrgid(os.getegid()))
    monkeypatch.setattr("gateway.atomic_io.os.fchown", refuse)
    write_private(tmp_path / "token", b"x", 0o640)
    assert (tmp_path / "token").stat().st_mode & 0o777 == 0o600
