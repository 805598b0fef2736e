"""Every single flipped bit of the small files that a gateway keeps is read without an exception that nobody handles."""

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.daemon.commands.security import load_or_create_token
from gateway.outbox import AlertOutbox
from gateway.page.sign_in import PIN_NAME, make_pin, read_pin
from gateway.pki.signing_key import KEY_NAME, KeyFileError, load_or_create_key, read_public_key
from gateway.recording.segments.events import is_trimmed, marker_path, read_event_intervals

CHANGE = b'{"number":1,"boot_id":"b","time_ns":5,"alert":{}}\n'


def load_key(path: Path) -> object:
    try:
        return load_or_create_key(path)
    except KeyFileError as error:
        return error


def load_public(path: Path) -> object:
    try:
        return read_public_key(str(path))
    except KeyFileError as error:
        return error


def load_marker(path: Path) -> object:
    segment = path.with_name(path.name.removesuffix(marker_path(Path("x")).name[1:]))
    return is_trimmed(segment), read_event_intervals(segment)


FILES: dict[str, tuple[Callable[[Path], object], Callable[[Path], object]]] = {
    "command-token": (lambda path: load_or_create_token(path.parent), lambda path: load_or_create_token(path.parent)),
    PIN_NAME: (make_pin, read_pin),
    KEY_NAME: (load_or_create_key, load_key),
    f"{KEY_NAME}.pub": (lambda path: load_or_create_key(path.with_suffix("")), load_public),
    marker_path(Path("a.mcap")).name: (
        lambda path: path.write_bytes(b'{"from_ns":1,"to_ns":2}\n{"from_ns":3,"to_ns":9}\n'),
        load_marker,
    ),
    "changes-00000001.log": (
        lambda path: path.write_bytes(CHANGE),
        lambda path: AlertOutbox(path.parent).newest(5),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(FILES))
def test_no_flipped_bit_of_a_small_state_file_raises(tmp_path: Path, name: str) -> None:
    make, load = FILES[name]
    path = tmp_path / name
    make(path)
    whole = path.read_bytes()
    load(path)
    for bit in range(8 * len(whole)):
        content = bytearray(whole)
        content[bit // 8] ^= 1 << bit % 8
        path.write_bytes(content)
        load(path)
