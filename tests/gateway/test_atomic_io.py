"""Files that are whole or not there."""

import os
from pathlib import Path
from typing import Any

import pytest

from gateway.atomic_io import append_durably, write_durably


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
    append_durably(path, b"one")
    with path.open("ab") as file:
        file.write(b"tor")
    append_durably(path, b"two")
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
