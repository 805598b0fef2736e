"""The index of a segment, read in milliseconds: its times, its metadata and its summary, without its messages.

Only the heads of the records of the data section are read, which is signed. The index at the end of a closed file is not: nothing
is taken from it.
"""

import os
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata
from mcap.writer import MCAP0_MAGIC

from devices.errors import RecordingError
from gateway.recording.format.frames import (
    FOOTER_BYTES,
    INDEX_HEAD,
    MAX_RECORD_BYTES,
    RECORD_HEAD,
    TIME_AND_OFFSET_BYTES,
)
from gateway.recording.format.salvage import CHUNK_TIMES, DAMAGED, FOOTER, open_mcap
from gateway.recording.summary.segment_summary import SUMMARY, SegmentSummary, decode_summary

READ_OPCODES = frozenset({Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.ATTACHMENT})
DATA_END_LENGTH = 4
"""Definition: the content of a data end record is a checksum (MCAP)."""
READ_BYTES = 1 << 20
"""Bytes that are read at once. Basis: a choice; more does not read faster, and a small board has the memory."""


@dataclass(slots=True)
class SegmentIndex:
    """What is known of a segment without its messages."""

    size_bytes: int
    is_closed: bool
    """The file has its end, and nothing may be added to it."""
    from_ns: int | None = None
    """Gateway time of the first message; None: there is none."""
    to_ns: int | None = None
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: list[str] = field(default_factory=list)
    summary: SegmentSummary | None = None
    """The summary that the recorder wrote; None: the segment must be read."""
    data_end: int = 0
    """Place of the record at the end of the data, which has their checksum; 0: not closed."""


def read_index(path: Path) -> SegmentIndex:
    """Return the index of a segment. Raises `RecordingError` where it cannot be read or is not an MCAP file."""
    with open_mcap(path) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            return _read_heads(file, size)
        except OSError as error:
            raise RecordingError(
                f"{path}: {error.strerror}; copy it off this disk with `ddrescue` and try again"
            ) from error


def is_altered(path: Path, index: SegmentIndex) -> bool:
    """Return whether the content of a closed file does not match its checksum. Raises `RecordingError`."""
    checksum, left = 0, index.data_end
    with open_mcap(path) as file:
        file.seek(0)
        while left > 0 and (part := file.read(min(left, READ_BYTES))):
            checksum = zlib.crc32(part, checksum)
            left -= len(part)
        record = file.read(RECORD_HEAD.size + DATA_END_LENGTH)
    promised = int.from_bytes(record[RECORD_HEAD.size :], "little")
    return record[:1] != bytes([Opcode.DATA_END]) or promised not in (0, checksum)


def _read_heads(file: BinaryIO, size: int) -> SegmentIndex:
    index = SegmentIndex(size, is_closed=False)
    count = 0
    file.seek(len(MCAP0_MAGIC))
    while len(head := file.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        end = file.tell() + length
        if opcode == 0 or end > size:  # 0 is not an opcode: some file systems leave zeros
            break
        if opcode == Opcode.DATA_END:
            index.data_end = end - length - RECORD_HEAD.size
            index.is_closed = _is_end(file, size)
            break
        if opcode in READ_OPCODES:
            with suppress(*DAMAGED):  # counted when the messages are read
                count += _add_record(index, file, opcode, length)
        file.seek(end)
    if not index.is_closed or (index.summary is not None and index.summary.message_count != count):
        index.summary = None  # the file goes on behind it, or it was copied from another file
    return index


def _is_end(file: BinaryIO, size: int) -> bool:
    """Return whether a file ends with a footer."""
    file.seek(max(0, size - FOOTER.size - len(MCAP0_MAGIC)))
    end = file.read()
    return end[: RECORD_HEAD.size] == RECORD_HEAD.pack(Opcode.FOOTER, FOOTER_BYTES) and end.endswith(MCAP0_MAGIC)


def _add_record(index: SegmentIndex, file: BinaryIO, opcode: int, length: int) -> int:
    """Add a record; return the number of messages that it tells of."""
    match opcode:
        case Opcode.CHUNK:
            first_ns, last_ns = CHUNK_TIMES.unpack(file.read(CHUNK_TIMES.size))
            index.from_ns = first_ns if index.from_ns is None else min(index.from_ns, first_ns)
            index.to_ns = last_ns if index.to_ns is None else max(index.to_ns, last_ns)
        case Opcode.MESSAGE_INDEX:
            _, entries_bytes = INDEX_HEAD.unpack(file.read(INDEX_HEAD.size))
            return int(entries_bytes) // TIME_AND_OFFSET_BYTES
        case Opcode.METADATA if length <= MAX_RECORD_BYTES:
            metadata = Metadata.read(_stream(file.read(length)))
            index.metadata[metadata.name] = metadata.metadata
        case Opcode.ATTACHMENT if length <= MAX_RECORD_BYTES:
            attachment = Attachment.read(_stream(file.read(length)))
            index.attachments.append(attachment.name)
            if attachment.name == SUMMARY:
                index.summary = decode_summary(attachment.data)
        case _:
            pass
    return 0


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
