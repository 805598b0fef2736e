"""The chain of a gateway's segments: statements about them, each with the hash of the one before, signed with its key.

A checkpoint in a segment that is being written states the bytes so far; the final statement of a compacted segment states all of
it. Both are metadata records named `signature`.
"""

import hashlib
import json
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from devices.errors import RecordingError
from gateway.file_input import decode_json
from gateway.recording.chain_state import (
    KEPT_ASIDE,
    STATE_NAME,
    ChainState,
    ChainStateError,
    SegmentNumber,
    list_aside,
    put_aside,
    read_state,
    save_state,
)
from gateway.recording.header import ORIGIN, segment_number
from gateway.recording.segment_index import read_index
from gateway.recording.signing_key import SigningKey, is_valid

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


class SegmentChain:
    """Numbers the segments and signs statements about them; used by the recording and the compaction thread."""

    def __init__(self, data_dir: Path, gateway: str, key: SigningKey | None) -> None:
        self._data_dir = data_dir
        self._gateway = gateway
        self.key = key
        """Signs the statements from now on; None: they are not signed."""
        self._lock = threading.Lock()
        self._state = ChainState()
        self.loss: str | None = None
        """What was lost of the state at the start, in one line; None: nothing."""

    def restore(self, newest_first: Sequence[Path]) -> None:
        """Continue from the saved state; where that is damaged, from the statements in these segments of former runs.

        A kill may have kept the number of the newest segment from being saved, so that its own statement counts in any case.
        """
        with self._lock:
            try:
                saved, problem = read_state(self._data_dir), None
            except ChainStateError as error:
                saved, problem = None, str(error)
            self._state = saved or ChainState()
            self._state.newest_segment = max(self._state.newest_segment, self._state.final_segment)
            for path in newest_first if saved is None else newest_first[:1]:
                self._learn(path)
            if saved is None and self._state.final_segment:
                problem = problem or f"{self._data_dir / STATE_NAME}: is missing"
            if problem is not None:
                self._state.rebuilt_before = self._state.newest_segment + 1
                self.loss = f"{problem}{self._put_aside()}; {_describe(self._state)}"
                with suppress(OSError):  # tried again with the next statement
                    self._save()

    def number_of(self, path: Path) -> int:
        """Return the number of a segment: by its signed statement, or by its metadata; 0: it has none or cannot be read."""
        return self._read(path)[0]

    def _learn(self, path: Path) -> None:
        """Raise the state to what a segment tells."""
        state, (number, statement, text) = self._state, self._read(path)
        state.newest_segment = max(number, state.newest_segment)
        if statement is None:
            return
        state.deleted_up_to = max(statement.deleted_up_to, state.deleted_up_to)
        state.rebuilt_before = max(statement.rebuilt_before, state.rebuilt_before)
        final = statement.previous_segment, statement.previous_sha256
        if statement.kind == "final":
            final = statement.segment, hash_of(text)
        if final[0] > state.final_segment:
            state.final_segment, state.final_sha256 = final

    def _read(self, path: Path) -> tuple[int, Statement | None, str]:
        """Return the number of a segment, and the last statement of this gateway in it, if there is one."""
        try:
            metadata = read_index(path).metadata
        except RecordingError:
            return 0, None, ""
        signature = metadata.get(SIGNATURE, {})
        text = signature.get("statement", "")
        statement = parse_statement(text)
        if statement is None or not self._is_own(statement, text, signature):
            return segment_number(metadata.get(ORIGIN, {})), None, ""
        return statement.segment, statement, text

    def _is_own(self, statement: Statement, text: str, signature: Mapping[str, str]) -> bool:
        """Return whether this gateway has signed a statement; without a key, whether it says so."""
        if self.key is None:
            return statement.gateway == self._gateway
        key = self.key.public_hex
        return statement.public_key == key and is_valid(key, text, signature.get("signature", ""))

    def _put_aside(self) -> str:
        """Keep the damaged file aside; return the name as a phrase."""
        try:
            replaces = " in place of the last one" if len(list_aside(self._data_dir)) == KEPT_ASIDE else ""
            return f"; it is kept as {put_aside(self._data_dir).name}{replaces}"
        except FileNotFoundError:
            return ""
        except OSError as error:
            return f"; it cannot be kept aside ({error.strerror or error})"

    @property
    def next_segment(self) -> int:
        """Number of the next segment."""
        with self._lock:
            return self._state.newest_segment + 1

    def note_segment(self, number: int) -> None:
        """Note that a segment has this number; later ones have higher numbers."""
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
            rebuilt_before=self._state.rebuilt_before,
            public_key="" if self.key is None else self.key.public_hex,
        )

    def _sign(self, statement: Statement) -> dict[str, str]:
        text = statement.text()
        return {"statement": text, "signature": "" if self.key is None else self.key.sign(text)}

    def _save(self) -> None:
        save_state(self._data_dir, self._state)


def _describe(state: ChainState) -> str:
    """Return what the recordings told, and what they cannot tell."""
    if not state.newest_segment:
        return "no recording tells the numbers of segments; they begin with 1"
    return (
        f"by the statements in the recordings, numbers go on with {state.rebuilt_before}; "
        "whether later segments and deletions were lost with it is not known"
    )
