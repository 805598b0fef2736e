"""Offline verification of a recording file against the gateway's statements about it, with the public key alone."""

import hashlib
import os
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from gateway.pki.signing_key import fingerprint, is_valid
from gateway.recording.chain.statements import DELETIONS, SIGNATURE, Statement, parse_statement
from gateway.recording.format.content import COPIES, ORIGIN, segment_number
from gateway.recording.format.frames import (
    INDEX_HEAD,
    TIME_AND_OFFSET_BYTES,
    ChunkReader,
    Frame,
    find_chunk,
    next_frame,
    records_of,
)
from gateway.recording.format.mcap_writer import SummarySection, serialise
from gateway.recording.format.salvage import DAMAGED, PARSERS, reading_mcap
from gateway.recording.format.segment_summary import SUMMARY
from gateway.recording.reading.interval import iso_utc

MAX_END_BYTES = 64_000_000
"""Longest end of a file that is compared. Basis: a choice; the index of a segment with half a million chunks is as long, and a
bound of the memory."""

SHOWN_RECORDS = 3
"""Damaged records that a message names. Basis: a choice; one line of a terminal."""
TORN = bytes(16)
"""What a power failure leaves at the end of a record of which the length was written. Basis: compressed data do not end so."""
WRONG_KEY = "WRONG KEY: "
"""Definition: how a verification begins what it says of a file that another key has signed."""
LEAST_SHOWN_S = 0.05
"""A shorter time at the end of a file is told in bytes. Definition: seconds are printed to a tenth."""


class RecomputedSummary:
    """Takes the records of the data section in their order; raises the exceptions `DAMAGED` for those that cannot be read."""

    def __init__(self, file_bytes: int) -> None:
        self._section = SummarySection()
        self._chunks = ChunkReader(file_bytes)
        self._unread: Chunk | None = None
        """The last chunk, whose schemas and channels are not known yet."""
        self._schemas: set[int] = set()
        self._channels: set[int] = set()

    def observe(self, frame: Frame, place: int) -> None:
        """Add a record."""
        head, opcode, content = frame
        length = len(head) + len(content)
        if opcode == Opcode.MESSAGE_INDEX:
            self._add_message_index(content, place, length)
            return
        record = PARSERS[opcode](content) if opcode in PARSERS else None
        match record:
            case Metadata():
                self._section.add_metadata(record, place, length)
            case Attachment():
                self._section.add_attachment(record, place, length)
            case Chunk():
                self._section.add_chunk(record, place, length)
                self._unread = record
            case _:
                pass

    def end(self, start: int, found: bytes) -> bytes:
        """Return the bytes that follow the data section; `found` are those that do."""
        if not self._section.chunk_count:  # no message was recorded, and the definitions stand here alone
            for opcode, content in records_of(found.removesuffix(MCAP0_MAGIC)):
                self._define(opcode, content)
        return self._section.encode(start) + MCAP0_MAGIC

    def _add_message_index(self, content: bytes, place: int, length: int) -> None:
        channel_id, entries_bytes = INDEX_HEAD.unpack_from(content)
        if not self._section.chunk_count:
            raise ValueError("an index of messages that no chunk precedes")
        if self._unread is not None and channel_id not in self._channels:
            for opcode, definition in self._chunks.frames(self._unread):
                self._define(opcode, definition)
            self._unread = None
        self._section.add_message_index(channel_id, entries_bytes // TIME_AND_OFFSET_BYTES, place, length)

    def _define(self, opcode: int, content: bytes) -> None:
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
            return
        record = PARSERS[opcode](content)
        if isinstance(record, Schema) and record.id not in self._schemas:
            self._schemas.add(record.id)
            self._section.schemas.append(record)
        elif isinstance(record, Channel) and record.id not in self._channels:
            self._channels.add(record.id)
            self._section.channels.append(record)


@dataclass(slots=True)
class FileVerification:
    """What was found in one file."""

    path: Path
    size_bytes: int = 0
    segment: int | None = None
    """Number that the statement gives, or the file claims where there is none; of a destroyed one that of its place, by its name;
    None: it is not of a chain."""
    statement: Statement | None = None
    """The last one that matches the content."""
    statement_text: str = ""
    deletions: dict[str, str] = field(default_factory=dict)
    """The last statement about deletions that is followed by a signature; empty: a version wrote the file that made none."""
    is_altered: bool = False
    """It differs from a statement in it, so that what follows cannot be judged."""
    has_end: bool = False
    """It ends as a closed MCAP file does, whatever is before."""
    is_destroyed: bool = False
    """It is no MCAP file any more."""
    is_strange: bool = False
    """It is no MCAP file, and the gateway has recorded nothing that it could have been."""
    is_closed: bool = False
    """Behind the data is the section that is made from them."""
    unsigned_bytes: int = 0
    """Bytes behind the last signature in a file that is not closed."""
    unsigned_to_ns: int = 0
    """Gateway time of the last message in them that can be read; 0: there is none."""
    copy: str = ""
    """How it was made of recordings; it was never signed, and is of no chain. Empty: it is no copy, or has a signature."""
    problems: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def is_final(self) -> bool:
        """Whether the whole segment is stated."""
        return self.statement is not None and self.statement.kind == "final"

    @property
    def open_end(self) -> str:
        """What no signature tells of the end of a file that is signed so far, as a clause; empty: all of it is."""
        if self.statement is None or self.is_final or self.is_closed:
            return ""
        unsigned_s = (self.unsigned_to_ns - self.statement.to_ns) / 1e9
        if unsigned_s >= LEAST_SHOWN_S:
            return f"the last {unsigned_s:.1f} s of {self.path.name} are not signed"
        if self.unsigned_bytes:
            return f"the last {self.unsigned_bytes} bytes of {self.path.name} are not signed"
        return f"{self.path.name} has no signature of the whole of it, and whether anything followed is not known"


def verify_file(path: Path, key: str | None) -> FileVerification:
    """Compare a file with the statements in it; `key`: the gateway's public key, None: not given.

    Raises `RecordingError` where the file cannot be read or is not MCAP, `KeyFileError` where signatures cannot be checked.
    """
    with reading_mcap(path) as file:
        return _FileCheck(path, file, key).run()


class _FileCheck:
    """One pass through a file."""

    def __init__(self, path: Path, file: BinaryIO, key: str | None) -> None:
        self._file = file
        self._key = key
        self._found = FileVerification(path, os.fstat(file.fileno()).st_size)
        self._hash = hashlib.sha256(MCAP0_MAGIC)
        self._checksum = zlib.crc32(MCAP0_MAGIC)
        self._summary = RecomputedSummary(self._found.size_bytes)
        self._origin_places: list[int] = []
        self._copy = ""
        self._has_signature = False
        self._claimed: int | None = None
        self._stated_bytes = self._signed_end = 0
        """Bytes that the last statement tells of; place behind it."""
        self._is_summarised = False
        """Whether it has the gateway's summary, which closes a segment."""
        self._is_read = False
        """Whether the end of the data was reached."""
        self._readable_bytes = 0
        """Place behind the last record that can be read."""
        self._deletions: dict[str, str] = {}
        self._damaged_place = -1
        """Place of the newest record that cannot be read."""
        self._places: list[int] = []
        """Of the chunks and attachments since the last statement that is right."""
        self._altered_to: int | None = None
        """Place of the first statement that is wrong; None: there is none."""

    def run(self) -> FileVerification:
        while (frame := self._next_frame()) is not None:
            place = self._file.tell() - len(frame[0]) - len(frame[2])
            if frame[1] == Opcode.DATA_END:
                self._is_read = True
                self._check_end(frame, place)
                break
            self._check_record(frame, place)
            for part in (frame[0], frame[2]):
                self._hash.update(part)
                self._checksum = zlib.crc32(part, self._checksum)
        self._file.seek(max(0, self._found.size_bytes - len(MCAP0_MAGIC)))
        self._found.has_end = self._file.read() == MCAP0_MAGIC
        if self._altered_to is not None:
            damaged = self._damaged_records()
            which = f"; damaged: {damaged}; each other chunk agrees with its checksum" if damaged else ""
            self._problem(
                f"ALTERED: bytes {self._stated_bytes} to {self._altered_to} are not what the gateway signed{which}"
            )
        self._conclude()
        return self._found

    def _next_frame(self) -> Frame | None:
        """Return the next record, behind damage where there is some."""
        place, size = self._file.tell(), self._found.size_bytes
        self._readable_bytes = place
        if (frame := next_frame(self._file, size)) is None and find_chunk(self._file, size):
            behind = self._file.tell()
            self._problem(f"ALTERED: bytes {place} to {behind} are no record of MCAP")
            self._found.is_altered = True
            frame = next_frame(self._file, size)
        return frame

    def _check_record(self, frame: Frame, place: int) -> None:
        _, opcode, content = frame
        if self._found.is_final:
            self._problem(f"ADDED: content at byte {place}, behind the final signature")
        try:
            self._summary.observe(frame, place)
            record = PARSERS[opcode](content) if opcode in (Opcode.METADATA, Opcode.ATTACHMENT) else None
        except DAMAGED:
            self._note_damage(self._places[-1] if opcode == Opcode.MESSAGE_INDEX and self._places else place)
            return
        if opcode in (Opcode.CHUNK, Opcode.ATTACHMENT):
            self._places.append(place)
        if not isinstance(record, Metadata):
            self._is_summarised |= isinstance(record, Attachment) and record.name == SUMMARY
            return
        if record.name == ORIGIN:
            self._origin_places.append(place)
            self._claimed = segment_number(record.metadata) or None
        elif record.name in COPIES:
            self._copy = COPIES[record.name]
        elif record.name == DELETIONS:
            self._deletions = record.metadata
        elif record.name == SIGNATURE:
            self._has_signature = True
            self._check_signature(record.metadata, place, len(frame[0]) + len(content))
            if serialise(record) != frame[0] + content or set(record.metadata) != {"statement", "signature"}:
                self._problem(f"ADDED: the record of the signature at byte {place} has more than the signature")

    def _note_damage(self, place: int) -> None:
        """Name a record that cannot be read, once: the indexes of a damaged chunk cannot either, and are not what was changed."""
        if place != self._damaged_place:
            self._problem(f"ALTERED: the record at byte {place} cannot be read")
        self._damaged_place = place

    def _check_signature(self, metadata: dict[str, str], place: int, length: int) -> None:
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
            if not self._found.is_altered:
                self._altered_to = place
            self._found.is_altered = True
            self._claimed = self._claimed or statement.segment
            return
        if statement.segment != self._claimed:
            self._problem(f"ALTERED: the signature at byte {place} is of segment {statement.segment}")
        before = self._found.statement
        if before is not None and statement.to_ns < before.to_ns:
            self._problem(f"CLOCK SET BACK by {(before.to_ns - statement.to_ns) / 1e9:.3f} s inside the file")
        self._places.clear()
        self._stated_bytes, self._signed_end = place, place + length
        self._found.statement, self._found.statement_text = statement, text
        self._found.deletions = self._deletions

    def _damaged_records(self) -> str:
        """Return which records since the last statement have a wrong checksum; empty: none, and something else was changed."""
        resume, size = self._file.tell(), self._found.size_bytes
        reader, damaged = ChunkReader(size), []
        for place in self._places:
            self._file.seek(place)
            if (frame := next_frame(self._file, size)) is None:
                continue
            end = self._file.tell()
            if frame[1] == Opcode.ATTACHMENT:
                if int.from_bytes(frame[2][-4:], "little") not in (0, zlib.crc32(frame[2][:-4])):
                    damaged.append(f"the attachment at bytes {place} to {end}")
                continue
            chunk = PARSERS[Opcode.CHUNK](frame[2])
            if not isinstance(chunk, Chunk):
                continue
            try:
                reader.frames(chunk)
                self._found.unsigned_to_ns = max(self._found.unsigned_to_ns, chunk.message_end_time)
            except DAMAGED:
                if end < self._readable_bytes or not frame[2].endswith(TORN):
                    times = f"{iso_utc(chunk.message_start_time)} to {iso_utc(chunk.message_end_time)}"
                    damaged.append(f"the chunk at bytes {place} to {end} (gateway time {times})")
        self._file.seek(resume)
        more = [f"{len(damaged) - SHOWN_RECORDS} more"] * (len(damaged) > SHOWN_RECORDS)
        return ", and ".join((*damaged[:SHOWN_RECORDS], *more))

    def _check_key(self, statement: Statement) -> None:
        if self._key is not None and statement.public_key != self._key:
            given = fingerprint(self._key)
            used = f"signed with the key {fingerprint(statement.public_key)}" if statement.public_key else "not signed"
            text = f"{WRONG_KEY}{used}, not with {given}"
            if text not in self._found.problems:  # each chunk of a file has a signature
                self._problem(text)

    def _check_end(self, frame: Frame, place: int) -> None:
        """Check that nothing unsigned is before the end of the data, and that what follows it is made from them."""
        content = frame[2]
        found, start = self._found, self._file.tell()
        if content != self._checksum.to_bytes(4, "little"):
            self._problem("ALTERED: the checksum of the data is wrong")
        if found.statement is None or found.is_altered:
            return
        if place != self._signed_end:
            self._problem(f"ADDED: bytes {self._signed_end} to {place} of the closed file are not signed")
        follows = self._file.read(MAX_END_BYTES)
        try:
            expected = self._summary.end(start, follows)
        except DAMAGED:
            expected = b""
        found.is_closed = bool(expected) and follows == expected
        if not found.is_closed and (len(follows) >= len(expected) or not expected.startswith(follows)):
            self._problem(
                f"ALTERED: what follows the data, from byte {start} on, is not made from what was signed; "
                "no summary or index in it can be believed"
            )
            found.is_closed = True  # and not merely cut off

    def _conclude(self) -> None:
        found = self._found
        if self._copy and not self._has_signature:
            found.copy = self._copy
            if not self._is_read:
                self._problem(f"CUT or ALTERED: from byte {self._readable_bytes} on it cannot be read")
            return
        for place in self._origin_places[1:]:
            self._problem(f"ADDED: the file says at byte {place} again whose it is")
        found.segment = self._claimed if found.statement is None else found.statement.segment
        if found.has_end and not self._is_read:
            self._problem(f"ALTERED: from byte {self._readable_bytes} on it cannot be read")
        elif found.has_end and found.statement is None and found.problems:
            return  # nothing is cut off, and what is damaged is said
        elif found.segment is None and found.statement is None:
            self._problem("NOT SIGNED: it has no number in a chain; a gateway of this version did not write it")
        elif found.is_final and not found.is_closed:
            self._problem("CUT or ALTERED: the end behind the final signature is missing or cannot be read")
        elif not found.is_final and not found.is_altered:
            self._describe_open_end()
        if found.statement is not None:
            self._describe(found.statement)

    def _describe(self, statement: Statement) -> None:
        remarks = self._found.remarks
        if not statement.public_key:
            remarks.append("not signed, chained by hashes only")
        if statement.replaces_sha256:
            remarks.append("trimmed by the quota to the time around events")
        if statement.repaired:
            since = f": what is later than {iso_utc(statement.repaired_from_ns)} was signed only then"
            if statement.to_ns <= statement.repaired_from_ns:
                since = ": nothing in it is later than its last signature"
            remarks.append(
                "was cut off by a kill or a power failure, and repaired and signed at the next start"
                + (since if statement.repaired_from_ns else "")
            )
        if statement.name != self._found.path.name:
            remarks.append(f"the gateway wrote it as {statement.name!r}")

    def _describe_open_end(self) -> None:
        """A segment without a final statement: being written, interrupted, or cut off."""
        found = self._found
        if found.statement is None:
            self._problem(
                "CUT: no signature; its end is cut off, unless it has its first seconds alone, in which none is made"
            )
        elif found.is_closed and not self._is_summarised:
            self._problem(
                "CUT: it was closed behind a signature that is not the gateway's last; what followed is missing"
            )
        elif found.is_closed:
            found.remarks.append("closed, and not compacted yet")
        else:
            found.unsigned_bytes = found.size_bytes - self._signed_end
            if damaged := self._damaged_records():
                why = "a kill cuts off and damages nothing before; a power failure may, on a card that loses what it had taken"
                self._problem(f"NOT SIGNED, AND DAMAGED: {damaged}; {why}")
            unsigned = (
                f"{found.unsigned_bytes} bytes at its end are not signed"
                if found.unsigned_bytes
                else "signed to its end"
            )
            found.remarks.append(f"not closed: being written, interrupted or cut off; {unsigned}")

    def _problem(self, text: str) -> None:
        self._found.problems.append(text)
