"""Offline verification of a recording file against the gateway's statements about it, with the public key alone."""

import hashlib
import os
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Metadata
from mcap.writer import MCAP0_MAGIC

from devices.errors import RecordingError
from gateway.recording.chain.signing_key import fingerprint, is_valid
from gateway.recording.chain.statements import DELETIONS, SIGNATURE, Statement, parse_statement
from gateway.recording.format.frames import Frame, find_chunk, next_frame
from gateway.recording.format.header import ORIGIN, segment_number
from gateway.recording.format.salvage import DAMAGED, FOOTER, PARSERS, open_mcap

CONTENT = frozenset({Opcode.CHUNK, Opcode.MESSAGE, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.SCHEMA, Opcode.CHANNEL})
"""Records that nothing may add behind the final signature; what follows it is made from the records before."""


@dataclass(slots=True)
class FileVerification:
    """What was found in one file."""

    path: Path
    size_bytes: int = 0
    segment: int | None = None
    """Number that the file claims; None: it is not of a chain."""
    statement: Statement | None = None
    """The last one that matches the content."""
    statement_text: str = ""
    deletions: dict[str, str] = field(default_factory=dict)
    """The last statement about deletions that is followed by a signature; empty: a version wrote the file that made none."""
    is_closed: bool = False
    problems: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def is_final(self) -> bool:
        """Whether the whole segment is stated."""
        return self.statement is not None and self.statement.kind == "final"


def verify_file(path: Path, key: str | None) -> FileVerification:
    """Compare a file with the statements in it; `key`: the gateway's public key, None: not given.

    Raises `RecordingError` where the file cannot be read or is not MCAP, `KeyFileError` where signatures cannot be checked.
    """
    with open_mcap(path) as file:
        try:
            return _FileCheck(path, file, key).run()
        except OSError as error:
            raise RecordingError(
                f"{path}: {error.strerror}; copy it off this disk with `ddrescue` and try again"
            ) from error


class _FileCheck:
    """One pass through a file."""

    def __init__(self, path: Path, file: BinaryIO, key: str | None) -> None:
        self._file = file
        self._key = key
        self._found = FileVerification(path, os.fstat(file.fileno()).st_size)
        self._hash = hashlib.sha256(MCAP0_MAGIC)
        self._checksum = zlib.crc32(MCAP0_MAGIC)
        self._stated_bytes = 0
        self._deletions: dict[str, str] = {}
        self._differs = False
        self._data_ended = False

    def run(self) -> FileVerification:
        while (frame := self._next_frame()) is not None:
            self._check_record(frame)
            if frame[1] == Opcode.FOOTER:
                self._check_end(frame)
                break
            self._hash.update(frame[0])
            self._hash.update(frame[2])
        self._conclude()
        return self._found

    def _next_frame(self) -> Frame | None:
        """Return the next record, behind damage where there is some."""
        place, size = self._file.tell(), self._found.size_bytes
        if (frame := next_frame(self._file, size)) is None and find_chunk(self._file, size):
            behind = self._file.tell()
            self._problem(f"ALTERED: bytes {place} to {behind} are no record of MCAP")
            self._differs = True
            frame = next_frame(self._file, size)
        return frame

    def _check_record(self, frame: Frame) -> None:
        head, opcode, content = frame
        place = self._file.tell() - len(head) - len(content)
        if self._found.is_final and opcode in CONTENT and not self._data_ended:
            self._problem(f"ADDED: content at byte {place}, behind the final signature")
        if opcode == Opcode.METADATA:
            self._check_metadata(content, place)
        elif opcode == Opcode.DATA_END:
            self._data_ended = True
            if int.from_bytes(content[:4], "little") != self._checksum:
                self._problem("ALTERED: the checksum of the data is wrong")
        self._checksum = zlib.crc32(content, zlib.crc32(head, self._checksum))

    def _check_metadata(self, content: bytes, place: int) -> None:
        try:
            record = PARSERS[Opcode.METADATA](content)
        except DAMAGED:
            self._problem(f"ALTERED: the metadata at byte {place} cannot be read")
            return
        if not isinstance(record, Metadata):
            return
        if record.name == ORIGIN and (number := segment_number(record.metadata)):
            self._found.segment = number
        elif record.name == DELETIONS:
            self._deletions = record.metadata
        elif record.name == SIGNATURE:
            self._check_signature(record.metadata, place)

    def _check_signature(self, metadata: dict[str, str], place: int) -> None:
        text = metadata.get("statement", "")
        statement = parse_statement(text)
        if statement is None:
            self._problem(f"ALTERED: the signature at byte {place} cannot be read")
            return
        if statement.public_key and not is_valid(statement.public_key, text, metadata.get("signature", "")):
            self._problem(f"FORGED: the signature at byte {place} does not belong to its statement")
            return
        self._check_key(statement)
        if statement.bytes != place or statement.sha256 != self._hash.hexdigest():
            if not self._differs:
                self._problem(f"ALTERED: bytes {self._stated_bytes} to {place} are not what the gateway signed")
            self._differs = True
            return
        if statement.segment != self._found.segment:
            self._problem(f"ALTERED: the signature at byte {place} is of segment {statement.segment}")
        before = self._found.statement
        if before is not None and statement.to_ns < before.to_ns:
            self._problem(f"CLOCK SET BACK by {(before.to_ns - statement.to_ns) / 1e9:.3f} s inside the file")
        self._stated_bytes = place
        self._found.statement, self._found.statement_text = statement, text
        self._found.deletions = self._deletions

    def _check_key(self, statement: Statement) -> None:
        if self._key is not None and statement.public_key != self._key:
            given = fingerprint(self._key)
            used = f"signed with the key {fingerprint(statement.public_key)}" if statement.public_key else "not signed"
            self._problem(f"WRONG KEY: {used}, not with {given}")

    def _check_end(self, frame: Frame) -> None:
        """Check the footer, the summary before it, and that nothing follows."""
        head, _, content = frame
        end = self._file.tell()
        self._found.is_closed = self._file.read() == MCAP0_MAGIC
        if not self._found.is_closed:
            self._problem(f"ALTERED: the end of the file, from byte {end}, is not that of MCAP")
        _, _, start, _, checksum = (
            FOOTER.unpack(head + content) if len(content) == FOOTER.size - len(head) else (0,) * 5
        )
        summary_end = end - len(head) - len(content)
        if not 0 < start <= summary_end:
            self._problem("ALTERED: the footer does not point to the summary")
            return
        self._file.seek(start)
        summary = self._file.read(summary_end - start)
        if checksum != zlib.crc32((head + content)[:-4], zlib.crc32(summary)):
            self._problem("ALTERED: the checksum of the summary is wrong")

    def _conclude(self) -> None:
        found = self._found
        if found.segment is None and found.statement is None:
            self._problem("NOT SIGNED: it has no number in a chain; a gateway of this version did not write it")
        elif found.is_final and not found.is_closed:
            self._problem("CUT or ALTERED: the end behind the final signature is missing or cannot be read")
        elif not found.is_final and not self._differs:
            self._describe_open_end()
        if found.statement is not None and not found.statement.public_key:
            found.remarks.append("not signed, chained by hashes only")
        if found.statement is not None and found.statement.replaces_sha256:
            found.remarks.append("trimmed by the quota to the time around events")
        if found.statement is not None and found.statement.repaired:
            found.remarks.append("was cut off by a kill or a power failure, and repaired and signed at the next start")

    def _describe_open_end(self) -> None:
        """A segment without a final statement: being written, interrupted, or cut off."""
        found = self._found
        rest = found.size_bytes - self._stated_bytes
        if found.statement is None:
            self._problem("CUT: no signature; its end is cut off, or it was interrupted in its first seconds")
        elif found.is_closed:
            found.remarks.append("closed, and not compacted yet")
        else:
            found.remarks.append(
                f"not closed: being written, interrupted or cut off; {rest} bytes at its end are not signed"
            )

    def _problem(self, text: str) -> None:
        self._found.problems.append(text)
