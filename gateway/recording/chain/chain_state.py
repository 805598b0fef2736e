"""The state of a gateway's chain of segments over a restart: `chain.json` in its data folder, signed, and with a checksum.

The signed statements in the recordings tell nearly the same: where the file is damaged or forged, the state is taken from them,
and the file is kept aside.
"""

import hashlib
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import msgspec

from gateway.atomic_io import sync_folder, write_durably
from gateway.errors import PlumblineError
from gateway.file_input import decode_json, read_bounded
from gateway.pki.signing_key import SigningKey, is_valid
from gateway.recording.format.content import MAX_SEGMENT_NUMBER

STATE_NAME = "chain.json"
ASIDE = ".damaged-{number}"
KEPT_ASIDE = 8
"""Number of damaged files that are kept: the first ones, and the last. Basis: a choice; the first damage explains most, and the
files do not fill the disk."""
WITHOUT_CHECKSUM = "newest_segment", "final_segment", "final_sha256", "deleted_up_to"
"""Fields of the file before it had a checksum."""
CHECKSUM = b',"sha256":"'
"""Last field of the file, with the SHA-256 of the others."""
SegmentNumber = Annotated[int, msgspec.Meta(ge=0, le=MAX_SEGMENT_NUMBER)]
Sha256 = Annotated[str, msgspec.Meta(pattern=r"^([0-9a-f]{64})?\Z")]


class ChainStateError(PlumblineError):
    """The state is there and cannot be used; the text names the file and the reason in one line."""


@dataclass(slots=True)
class ChainState:
    """What the chain has to remember over a restart."""

    newest_segment: SegmentNumber = 0
    """Number of the segment that was begun last."""
    final_segment: SegmentNumber = 0
    final_sha256: Sha256 = ""
    """Number and hash of the last final statement."""
    deleted_up_to: SegmentNumber = 0
    rebuilt_before: SegmentNumber = 0
    """Number of the first segment after this state was last lost and taken from the recordings; 0: never."""
    deletions: dict[str, str] = field(default_factory=dict)
    """The signed statement about the segments that were deleted; empty: none was made."""
    signature: str = ""
    """Of all the others, by the gateway's key. Empty: not signed, or by a version that did not sign it."""


def has_sound_state(data_dir: Path) -> bool:
    """Return whether a folder has a state that can be read, which names the newest segment."""
    try:
        return read_state(data_dir) is not None
    except ChainStateError:
        return False


def read_state(data_dir: Path) -> ChainState | None:
    """Return the state that is saved in a folder; None where there is none. Raises `ChainStateError` for a damaged one."""
    path = data_dir / STATE_NAME
    try:
        content = read_bounded(path)
    except OSError as error:
        if isinstance(error, FileNotFoundError) and not path.is_symlink():
            return None
        raise ChainStateError(f"{path}: cannot be read ({error.strerror or error})") from error
    try:
        state = decode_json(content, ChainState)
    except ValueError as error:
        raise ChainStateError(f"{path}: is damaged") from error
    if not _has_checksum(content) and content != _encode_without_checksum(state):
        raise ChainStateError(f"{path}: is damaged, or was changed: its checksum is wrong")
    return state


def save_state(data_dir: Path, state: ChainState, key: SigningKey | None = None) -> None:
    """Save the state, signed with a key. Raises `OSError`."""
    state.signature = "" if key is None else key.sign(_signed_text(state))
    write_durably(data_dir / STATE_NAME, _encode(state))


def is_signed(state: ChainState, public_key: str) -> bool:
    """Return whether a key has signed the state. Raises `KeyFileError` where signatures cannot be checked."""
    return bool(public_key) and is_valid(public_key, _signed_text(state), state.signature)


def _signed_text(state: ChainState) -> str:
    return msgspec.json.encode(replace(state, signature="")).decode()


def put_aside(data_dir: Path) -> Path:
    """Give a damaged file another name, for an investigation, and return that. Raises `OSError`."""
    names = _names_aside(data_dir)
    aside = next((name for name in names if not os.path.lexists(name)), names[-1])
    (data_dir / STATE_NAME).replace(aside)
    sync_folder(data_dir)
    return aside


def list_aside(data_dir: Path) -> list[Path]:
    """Return the damaged files that were kept."""
    return [name for name in _names_aside(data_dir) if os.path.lexists(name)]


def _names_aside(data_dir: Path) -> list[Path]:
    return [data_dir / f"{STATE_NAME}{ASIDE.format(number=number)}" for number in range(1, KEPT_ASIDE + 1)]


def _encode(state: ChainState) -> bytes:
    content = msgspec.json.encode(state)
    return content[:-1] + _checksum(content)


def _has_checksum(content: bytes) -> bool:
    """Return whether a file ends with the checksum of what is before."""
    place = content.rfind(CHECKSUM)
    return place > 0 and content[place:] == _checksum(content[:place] + b"}")


def _checksum(content: bytes) -> bytes:
    return CHECKSUM + hashlib.sha256(content).hexdigest().encode() + b'"}'


def _encode_without_checksum(state: ChainState) -> bytes:
    return msgspec.json.encode({name: getattr(state, name) for name in WITHOUT_CHECKSUM})
