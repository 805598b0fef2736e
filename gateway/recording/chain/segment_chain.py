"""The chain of a gateway's segments: statements about them, each with the hash of the one before, signed with its key."""

import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

from devices.errors import RecordingError
from gateway.messages import NewestStatement
from gateway.pki.signing_key import SigningKey
from gateway.recording.chain.chain_state import (
    KEPT_ASIDE,
    STATE_NAME,
    ChainState,
    ChainStateError,
    list_aside,
    put_aside,
    read_state,
    save_state,
)
from gateway.recording.chain.statements import (
    DELETIONS,
    SIGNATURE,
    Deletion,
    DeletionReason,
    DeletionStatement,
    Statement,
    StatementKind,
    has_signature,
    hash_of,
    is_forged,
    parse_deletions,
    parse_statement,
)
from gateway.recording.format.content import ORIGIN, segment_number
from gateway.recording.reading.recording_file import read_index


class SegmentChain:
    """Numbers the segments and signs statements about them; used by the recording and the compaction thread."""

    def __init__(self, data_dir: Path, gateway: str, key: SigningKey | None) -> None:
        self._data_dir = data_dir
        self._gateway = gateway
        self.key = key
        """Signs the statements from now on; None: they are not signed."""
        self._lock = threading.Lock()
        self._state = ChainState()
        self._deleted = DeletionStatement(gateway=gateway)
        self.newest: NewestStatement | None = None
        """The newest final statement; read without the lock, which may wait for the disk."""
        self.loss: str | None = None
        """What was lost of the state at the start, in one line; None: nothing."""

    def restore(self, newest_first: Sequence[Path]) -> None:
        """Continue from the saved state; where that is damaged or forged, from the statements in these segments of former runs.

        A kill may have kept the number of the newest segment from being saved, so that its own statement counts in any case.
        """
        with self._lock:
            try:
                saved, problem = self._read_saved(newest_first), None
            except ChainStateError as error:
                saved, problem = None, str(error)
            self._state = saved or ChainState()
            was_signed = bool(self._state.signature)
            self._state.newest_segment = max(self._state.newest_segment, self._state.final_segment)
            stated = self._take_deletions(self._state.deletions)
            for path in newest_first if saved is None else newest_first[:1]:
                stated |= self._learn(path)
            if not stated:  # by a version that stated the largest number alone, or without this key
                self._deleted = replace(self._deleted, unstated_up_to=self._state.deleted_up_to)
            self._sign_deletions()
            self._publish()
            if saved is None and self._state.final_segment:
                problem = problem or f"{self._data_dir / STATE_NAME}: is missing"
            if problem is not None:
                self._state.rebuilt_before = self._state.newest_segment + 1
                self.loss = f"{problem}{self._put_aside()}; {_describe(self._state)}"
            if problem is not None or (saved is not None and self.key is not None and not was_signed):
                with suppress(OSError):  # tried again with the next statement
                    self._save()

    def _read_saved(self, newest_first: Sequence[Path]) -> ChainState | None:
        """Return the saved state, if there is one. Raises `ChainStateError` where it is damaged or forged.

        The newest statement of this gateway tells whether it signs the state, whatever others have put beside its segments. What
        another key has signed proves nothing, also where it was the gateway's own before.
        """
        state = read_state(self._data_dir)
        own = (statement for path in newest_first if (statement := self._read(path)[1]) is not None)
        if state is not None and self.key is not None and is_forged(state, islice(own, 1), self.key.public_hex):
            raise ChainStateError(f"{self._data_dir / STATE_NAME}: is not signed with the gateway's key")
        return state

    def number_of(self, path: Path) -> int:
        """Return the number of a segment: by its signed statement, or by its metadata; 0: it has none or cannot be read."""
        return self._read(path)[0]

    def _take_deletions(self, record: Mapping[str, str]) -> bool:
        """Add what a statement says was deleted; return whether this key has signed it; without a key, whether it is one."""
        statement = parse_deletions(record)
        if statement is None or (self.key and not has_signature(record, statement, self.key.public_hex)):
            return False
        self._deleted = self._deleted.including(statement)
        return True

    def _learn(self, path: Path) -> bool:
        """Raise the state to what a segment tells; return whether it tells what was deleted."""
        state, (number, statement, text, metadata) = self._state, self._read(path)
        state.newest_segment = max(number, state.newest_segment)
        if statement is None:
            return False
        state.deleted_up_to = max(statement.deleted_up_to, state.deleted_up_to)
        state.rebuilt_before = max(statement.rebuilt_before, state.rebuilt_before)
        final = statement.previous_segment, statement.previous_sha256
        if statement.kind == "final":
            final = statement.segment, hash_of(text)
        if final[0] > state.final_segment:
            state.final_segment, state.final_sha256 = final
        return self._take_deletions(metadata.get(DELETIONS, {}))

    def _read(self, path: Path) -> tuple[int, Statement | None, str, Mapping[str, Mapping[str, str]]]:
        """Return the number of a segment, the last statement of this gateway in it, if there is one, and its metadata."""
        try:
            metadata = read_index(path).metadata
        except RecordingError:
            return 0, None, "", {}
        signature = metadata.get(SIGNATURE, {})
        text = signature.get("statement", "")
        statement = parse_statement(text)
        if statement is None or not self._is_own(statement, signature):
            return segment_number(metadata.get(ORIGIN, {})), None, "", metadata
        return statement.segment, statement, text, metadata

    def _is_own(self, statement: Statement, signature: Mapping[str, str]) -> bool:
        """Return whether this gateway has signed a statement; without a key, whether it says so."""
        if self.key is None:
            return statement.gateway == self._gateway
        return has_signature(signature, statement, self.key.public_hex)

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

    def sign(
        self,
        kind: StatementKind,
        *,
        segment: int,
        name: str,
        n_bytes: int,
        sha256: str,
        from_ns: int,
        to_ns: int,
        repaired_from_ns: int | None = None,
    ) -> dict[str, str]:
        """Return the signature of a segment so far, or of the whole of it; `commit` a final one when the file is in its place.

        `repaired_from_ns` is the time of the last signature in a segment that had been cut off; None: it had not been.
        """
        with self._lock:
            statement = Statement(
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
                repaired=repaired_from_ns is not None,
                repaired_from_ns=repaired_from_ns or 0,
                rebuilt_before=self._state.rebuilt_before,
                public_key=self._public_key,
            )
            return self._sign(statement)

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
                public_key=self._public_key,
            )
            return self._sign(part)

    def commit(self, segment: int, signature: dict[str, str]) -> None:
        """Make a final statement the one that the next statements follow, if it is of the newest segment. Raises `OSError`."""
        with self._lock:
            if segment < self._state.final_segment:
                return
            self._state.final_segment, self._state.final_sha256 = segment, hash_of(signature["statement"])
            self._publish()
            self._save()

    def note_deletion(self, segment: int, reason: DeletionReason, quota_mb: float) -> None:
        """Note that a segment is deleted, before that is done; the next statement says so. Raises `OSError`."""
        with self._lock:
            deletion = Deletion(reason, quota_mb, ((segment, segment),))
            stated = DeletionStatement(gateway=self._gateway, deleted=(deletion,))
            self._deleted = self._deleted.including(stated).bounded()
            self._state.deleted_up_to = max(segment, self._state.deleted_up_to)
            self._sign_deletions()
            self._save()

    @property
    def deletions(self) -> dict[str, str]:
        """The signed statement about the segments that were deleted."""
        with self._lock:
            return self._state.deletions

    def _publish(self) -> None:
        """Let others read what the newest final statement is."""
        if self._state.final_segment:
            self.newest = NewestStatement(
                gateway=self._gateway,
                segment=self._state.final_segment,
                sha256=self._state.final_sha256,
                public_key=self._public_key,
            )

    @property
    def _public_key(self) -> str:
        return "" if self.key is None else self.key.public_hex

    def _sign_deletions(self) -> None:
        self._deleted = replace(self._deleted, public_key=self._public_key)
        self._state.deletions = self._sign(self._deleted)

    def _sign(self, statement: Statement | DeletionStatement) -> dict[str, str]:
        text = statement.text()
        return {"statement": text, "signature": "" if self.key is None else self.key.sign(text)}

    def _save(self) -> None:
        save_state(self._data_dir, self._state, self.key)


def newest_signed(data_dir: Path) -> Statement | None:
    """Return the last statement in the newest signed recording in a folder; None: none is signed."""
    for path in sorted(data_dir.glob("*.mcap"), reverse=True):
        with suppress(RecordingError):
            statement = parse_statement(read_index(path).metadata.get(SIGNATURE, {}).get("statement", ""))
            if statement is not None and statement.public_key:
                return statement
    return None


def _describe(state: ChainState) -> str:
    """Return what the recordings told, and what they cannot tell."""
    if not state.newest_segment:
        return "no recording tells the numbers of segments; they begin with 1"
    return (
        f"by the statements in the recordings, numbers go on with {state.rebuilt_before}; "
        "whether later segments and deletions were lost with it is not known"
    )
