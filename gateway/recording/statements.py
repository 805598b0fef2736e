"""What a gateway states about a segment: a text in JSON that stands in the segment with its signature.

A checkpoint in a segment that is being written states the bytes so far; the final statement of a compacted segment states all of
it. Both are metadata records named `signature`.
"""

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Literal

from gateway.file_input import decode_json
from gateway.recording.chain_state import SegmentNumber

SIGNATURE = "signature"
StatementKind = Literal["checkpoint", "final"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """What the gateway states about a segment up to the signature; times are gateway times."""

    format: int = 1
    kind: StatementKind
    gateway: str
    name: str
    """The file's name."""
    segment: SegmentNumber
    """Number of the segment, from 1 on."""
    previous_segment: SegmentNumber
    """Number of the last segment with a final statement; 0: none."""
    previous_sha256: str
    """Hash of that statement."""
    deleted_up_to: SegmentNumber
    """Largest number of a segment that the quota has deleted; which ones, a statement of their own says, see `deletions`."""
    bytes: int
    """Length of the file before the signature."""
    sha256: str
    """Hash of these bytes."""
    from_ns: int
    to_ns: int
    """Gateway times of the first and the last message."""
    repaired: bool = False
    """The segment had ended in a kill or a power failure."""
    replaces_sha256: str = ""
    """Hash of the statement about the whole segment, where this file has the time around its events only."""
    rebuilt_before: SegmentNumber = 0
    """Number of the first segment after the gateway had lost what it remembers of its chain, and had taken it from its
    recordings: what these do not tell is not stated. 0: never."""
    public_key: str = ""
    """Empty: not signed."""

    def text(self) -> str:
        """Return the bytes that are signed, as text."""
        return json.dumps(asdict(self), separators=(",", ":"))


def parse_statement(text: str) -> Statement | None:
    """Return the statement of a signature; None where it is none."""
    try:
        return decode_json(text, Statement)
    except ValueError:
        return None


def hash_of(text: str) -> str:
    """Return the hash of a statement, for the next one."""
    return hashlib.sha256(text.encode()).hexdigest()
