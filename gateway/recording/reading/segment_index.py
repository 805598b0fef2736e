"""The index of a segment, read in milliseconds: its times, its metadata and its summary, without its messages.

A closed file has an index at its end. Of an incomplete one, or one that is being written, only the heads of the records are read.
"""

import os
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Metadata, MetadataIndex, Statistics
from mcap.writer import MCAP0_MAGIC

from devices.errors import RecordingError
from gateway.recording.format.frames import FOOTER_BYTES, RECORD_HEAD
from gateway.recording.format.salvage import CHUNK_TIMES, DAMAGED, FOOTER, open_mcap
from gateway.recording.summary.segment_summary import SUMMARY, SegmentSummary, decode_summary

DATA_END_LENGTH = 4
"""Definition: the content of a data end record is a checksum (MCAP)."""
READ_BYTES = 1 << 20
"""Bytes that are read at once. Basis: a choice; more does not read faster, and a small board has the memory."""


@dataclass(slots=True)
class SegmentIndex:
    """What is known of a segment without its messages."""

    size_bytes: int
    is_closed: bool
    """The index at the end of the file is complete."""
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
            return _from_summary_section(file, size) or _from_heads(file, size)
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


def _from_summary_section(file: BinaryIO, size: int) -> SegmentIndex | None:
    """Return the index of a closed file; None where the file is not closed, or its summary section is damaged."""
    end = size - FOOTER.size - len(MCAP0_MAGIC)
    if end < len(MCAP0_MAGIC):
        return None
    file.seek(end)
    footer = file.read(FOOTER.size)
    opcode, length, start, _, checksum = FOOTER.unpack(footer)
    if (opcode, length) != (Opcode.FOOTER, FOOTER_BYTES) or file.read() != MCAP0_MAGIC or not 0 < start <= end:
        return None
    file.seek(start)
    section = file.read(end - start)
    if checksum not in (0, zlib.crc32(footer[:-4], zlib.crc32(section))):
        return None
    try:
        index = SegmentIndex(size, is_closed=True, data_end=start - RECORD_HEAD.size - DATA_END_LENGTH)
        return _parse_section(file, section, index)
    except DAMAGED:
        return None


def _parse_section(file: BinaryIO, section: bytes, index: SegmentIndex) -> SegmentIndex | None:
    """Complete the index from the records of the summary section; None where it has no statistics."""
    statistics = None
    for opcode, content in _frames(section):
        if opcode == Opcode.STATISTICS:
            statistics = Statistics.read(_stream(content))
        elif opcode == Opcode.METADATA_INDEX:
            entry = MetadataIndex.read(_stream(content))
            metadata = Metadata.read(_stream(_content_at(file, entry.offset, entry.length)))
            index.metadata[metadata.name] = metadata.metadata
        elif opcode == Opcode.ATTACHMENT_INDEX:
            _add_attachment(index, file, AttachmentIndex.read(_stream(content)))
    if statistics is None:
        return None
    if statistics.message_count:
        index.from_ns, index.to_ns = statistics.message_start_time, statistics.message_end_time
    if index.summary is not None and index.summary.message_count != statistics.message_count:
        index.summary = None  # it was copied from another file
    return index


def _add_attachment(index: SegmentIndex, file: BinaryIO, entry: AttachmentIndex) -> None:
    index.attachments.append(entry.name)
    if entry.name == SUMMARY:
        attachment = Attachment.read(_stream(_content_at(file, entry.offset, entry.length)))
        index.summary = decode_summary(attachment.data)


def _content_at(file: BinaryIO, offset: int, length: int) -> bytes:
    file.seek(offset + RECORD_HEAD.size)
    return file.read(length - RECORD_HEAD.size)


def _frames(section: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record. Raises `struct.error` where the last one is incomplete."""
    place = 0
    while place < len(section):
        opcode, length = RECORD_HEAD.unpack_from(section, place)
        place += RECORD_HEAD.size
        yield opcode, section[place : place + length]
        place += length


def _from_heads(file: BinaryIO, size: int) -> SegmentIndex:
    """Return the index of a file without one, by the heads of its complete records."""
    index = SegmentIndex(size, is_closed=False)
    file.seek(len(MCAP0_MAGIC))
    while len(head := file.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        end = file.tell() + length
        if opcode == 0 or end > size:  # 0 is not an opcode: some file systems leave zeros
            break
        with suppress(*DAMAGED):  # counted when the messages are read
            _add_record(index, file, opcode, length)
        file.seek(end)
    return index


def _add_record(index: SegmentIndex, file: BinaryIO, opcode: int, length: int) -> None:
    match opcode:
        case Opcode.CHUNK:
            first_ns, last_ns = CHUNK_TIMES.unpack(file.read(CHUNK_TIMES.size))
            index.from_ns = first_ns if index.from_ns is None else min(index.from_ns, first_ns)
            index.to_ns = last_ns if index.to_ns is None else max(index.to_ns, last_ns)
        case Opcode.METADATA:
            metadata = Metadata.read(_stream(file.read(length)))
            index.metadata[metadata.name] = metadata.metadata
        case Opcode.ATTACHMENT:
            index.attachments.append(Attachment.read(_stream(file.read(length))).name)
        case _:
            pass


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
