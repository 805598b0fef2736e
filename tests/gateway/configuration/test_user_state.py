"""The folders in which `plumbline remote` looks for tokens: those that exist, the newest first, and only a few."""

import os
from pathlib import Path

import pytest

from gateway.configuration.user_state import MAX_FOLDERS, known_data_folders, remember_data_folder


def test_folders_are_remembered_newest_first_and_forgotten_when_they_are_gone(tmp_path: Path) -> None:
    environment = {"XDG_STATE_HOME": str(tmp_path / "state")}
    folders = [tmp_path / name for name in ("one", "two")]
    for number, folder in enumerate(folders):
        folder.mkdir()
        remember_data_folder(folder, environment)
        for entry in (tmp_path / "state" / "plumbline" / "data-folders").iterdir():
            if str(folder) in entry.read_text():
                os.utime(entry, (number, number))
    assert known_data_folders(environment) == [folders[1], folders[0]]
    (tmp_path / "state" / "plumbline" / "data-folders" / "replaced").symlink_to("gone")  # as while another one is noted
    assert known_data_folders(environment) == [folders[1], folders[0]]
    folders[1].rmdir()
    assert known_data_folders(environment) == [folders[0]]


@pytest.mark.slow
def test_a_bounded_number_is_kept_and_without_a_home_none(tmp_path: Path) -> None:
    environment = {"XDG_STATE_HOME": str(tmp_path / "state")}
    for number in range(MAX_FOLDERS + 3):
        remember_data_folder(tmp_path / str(number), environment)
    assert len(list((tmp_path / "state" / "plumbline" / "data-folders").iterdir())) == MAX_FOLDERS
    remember_data_folder(tmp_path, {})
    assert known_data_folders({}) == []
    remember_data_folder(tmp_path, {"HOME": "/proc/no-such-home"})
