"""The credentials that a client finds in a data folder."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.authorization.credential import TOKEN_NAME
from gateway.bus.credentials import load_credentials
from gateway.errors import InputError


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero")], ids=["pipe", "device"])
def test_a_token_that_is_no_file_is_none_and_is_not_waited_for(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / TOKEN_NAME)
    with pytest.raises(InputError, match="has no readable command-token"):
        load_credentials(tmp_path)
