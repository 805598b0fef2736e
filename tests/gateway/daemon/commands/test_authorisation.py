"""The file of the command token: made once, private, and never a way in where it cannot be used."""

import stat
from pathlib import Path

import pytest

from gateway.daemon.commands.security import load_or_create_token


def test_the_token_is_made_once_and_only_the_group_may_read_it(tmp_path: Path) -> None:
    secret = load_or_create_token(tmp_path)
    path = tmp_path / "command-token"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert bytes.fromhex(path.read_text()) == secret == load_or_create_token(tmp_path)
    assert load_or_create_token(tmp_path / "other") != secret


@pytest.mark.parametrize("content", [b"", b"00", b"zz" * 32, b"\xff\xfe"])
def test_a_damaged_token_lets_nobody_in_and_is_not_replaced(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "command-token"
    path.write_bytes(content)
    secrets = {load_or_create_token(tmp_path) for _ in range(2)}
    assert len(secrets) == 2  # random each time: known to nobody
    assert path.read_bytes() == content


def test_a_folder_that_cannot_be_written_lets_nobody_in(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file where a folder should be")
    assert load_or_create_token(tmp_path / "file") != load_or_create_token(tmp_path / "file")
