"""The chain of a gateway's segments: statements about them, each with the hash of the one before, signed with its key.

A checkpoint in a segment that is being written states the bytes so far; the final statement of a compacted segment states all of
it. Both are metadata records named `signature`.
"""

import hashlib
import json
import threading
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec

from gateway.atomic_io import write_durably
from gateway.file_input import read_bounded
from gateway.recording.signing_key import SigningKey

SIGNATURE = "signature"
STATE_NAME = "chain.json"
StatementKind = Literal["checkpoint", "final"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """What the gateway states about a segment up to the signature; times are gateway times."""

    format: int = 1
    kind: StatementKind
    gateway: str
    name: str
    """The file's name."""
    segment: int
    """Number of the segment, from 1 on."""
    previous_segment: int
    """Number of the last segment with a final statement; 0: none."""
    previous_sha256: str
    """Hash of that statement."""
    deleted_up_to: int
    """The quota has deleted segments up to this number, so that older ones may be missing."""
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
    public_key: str = ""
    """Empty: not signed."""

    def text(self) -> str:
        """Return the bytes that are signed, as text."""
        return json.dumps(asdict(self), separators=(",", ":"))


def parse_statement(text: str) -> Statement | None:
    """Return the statement of a signature; None where it is none."""
    try:
        return msgspec.json.decode(text, type=Statement)
    except (msgspec.MsgspecError, RecursionError):
        return None


def hash_of(text: str) -> str:
    """Return the hash of a statement, for the next one."""
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(slots=True)
class ChainState:
    """What the chain has to remember over a restart."""

    newest_segment: int = 0
    """Number of the segment that was begun last."""
    final_segment: int = 0
    final_sha256: str = ""
    """Number and hash of the last final statement."""
    deleted_up_to: int = 0


class SegmentChain:
    """Numbers the segments and signs statements about them; used by the recording and the compaction thread."""

    def __init__(self, data_dir: Path, gateway: str, key: SigningKey | None) -> None:
        self._path = data_dir / STATE_NAME
        self._gateway = gateway
        self.key = key
        """Signs the statements from now on; None: they are not signed."""
        self._lock = threading.Lock()
        self._state = read_state(data_dir) or ChainState()

    @property
    def next_segment(self) -> int:
        """Number of the next segment."""
        with self._lock:
            return self._state.newest_segment + 1

    def note_segment(self, number: int) -> None:
        """Note that a segment has this number; later ones have higher numbers.

        That of the newest file is noted at each start, so that a kill before the next statement is saved costs nothing.
        """
        with self._lock:
            self._state.newest_segment = max(number, self._state.newest_segment)

    def checkpoint(
        self, *, segment: int, name: str, n_bytes: int, sha256: str, from_ns: int, to_ns: int
    ) -> dict[str, str]:
        """Return the signature of a segment that is being written."""
        with self._lock:
            return self._sign(self._statement("checkpoint", segment, name, n_bytes, sha256, from_ns, to_ns, False))

    def final(
        self, *, segment: int, name: str, n_bytes: int, sha256: str, from_ns: int, to_ns: int, repaired: bool
    ) -> dict[str, str]:
        """Return the final signature of a segment; `commit` it when the file is in its place."""
        with self._lock:
            return self._sign(self._statement("final", segment, name, n_bytes, sha256, from_ns, to_ns, repaired))

    def trimmed(self, text: str, *, n_bytes: int, sha256: str, from_ns: int, to_ns: int) -> dict[str, str]:
        """Return the final signature of a part of a segment, about which a statement was made as a whole."""
        whole = parse_statement(text)
        if whole is None:
            raise ValueError("the statement about the whole segment cannot be read")
        with self._lock:
            part = replace(
                whole,
                bytes=n_bytes,
                sha256=sha256,
                from_ns=from_ns,
                to_ns=to_ns,
                deleted_up_to=self._state.deleted_up_to,
                replaces_sha256=hash_of(text),
                public_key="" if self.key is None else self.key.public_hex,
            )
            return self._sign(part)

    def commit(self, segment: int, signature: dict[str, str]) -> None:
        """Make a final statement the one that the next statements follow, if it is of the newest segment. Raises `OSError`."""
        with self._lock:
            if segment < self._state.final_segment:
                return
            self._state.final_segment, self._state.final_sha256 = segment, hash_of(signature["statement"])
            self._save()

    def note_deleted(self, segment: int) -> None:
        """Note that the quota has deleted a segment; the next statement says so. Raises `OSError`."""
        with self._lock:
            self._state.deleted_up_to = max(segment, self._state.deleted_up_to)
            self._save()

    def _statement(
        self,
        kind: StatementKind,
        segment: int,
        name: str,
        n_bytes: int,
        sha256: str,
        from_ns: int,
        to_ns: int,
        repaired: bool,
    ) -> Statement:
        return Statement(
            kind=kind,
            gateway=self._gateway,
            name=name,
            segment=segment,
            previous_segment=self._state.final_segment,
            previous_sha256=self._state.final_sha256,
            deleted_up_to=self._state.deleted_up_to,
            bytes=n_bytes,
            sha256=sha256,
            from_ns=from_ns,
            to_ns=to_ns,
            repaired=repaired,
            public_key="" if self.key is None else self.key.public_hex,
        )

    def _sign(self, statement: Statement) -> dict[str, str]:
        text = statement.text()
        return {"statement": text, "signature": "" if self.key is None else self.key.sign(text)}

    def _save(self) -> None:
        write_durably(self._path, msgspec.json.encode(self._state))


def read_state(data_dir: Path) -> ChainState | None:
    """Return the state of the chain in a folder; None where there is none that can be read."""
    try:
        return msgspec.json.decode(read_bounded(data_dir / STATE_NAME), type=ChainState)
    except (OSError, msgspec.MsgspecError, RecursionError):
        return None
