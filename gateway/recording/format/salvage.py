"""The readable records of an MCAP file that a power failure, a full disk or a bad sector has left incomplete.

For such a file the readers of the `mcap` package return nothing or raise various exceptions. This one separates the records by
their lengths, stops at the incomplete end, skips damaged records, and counts both.
"""

import os
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from devices.errors import RecordingError
from devices.regular_file import open_regular
from gateway.errors import counted
from gateway.file_input import reason_of
from gateway.recording.format.frames import (
    FOOTER_BYTES,
    MAX_RECORD_BYTES,
    ChunkReader,
    find_chunk,
    next_frame,
    records_of,
)

FOOTER = struct.Struct("<BQQQI")
"""Opcode, length, start of the summary, start of its offsets, checksum of the summary."""
CHUNK_TIMES = struct.Struct("<QQ")
"""First and last time of a chunk, at the start of its content."""
MESSAGE_FIELDS = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time of a message, before its payload."""
DAMAGED = (McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError, MemoryError, OverflowError)
"""Exceptions of the package for content that does not match its length; RuntimeError comes from lz4."""


def _read_message(content: bytes) -> Message:
    """Return a message as `Message.read` does, in a quarter of its time."""
    channel_id, sequence, log_time, publish_time = MESSAGE_FIELDS.unpack_from(content)
    return Message(channel_id, log_time, content[MESSAGE_FIELDS.size :], publish_time, sequence)


PARSERS: dict[int, Callable[[bytes], McapRecord]] = {
    Opcode.HEADER: lambda content: Header.read(_stream(content)),
    Opcode.MESSAGE: _read_message,
    Opcode.SCHEMA: lambda content: Schema.read(_stream(content)),
    Opcode.CHANNEL: lambda content: Channel.read(_stream(content)),
    Opcode.CHUNK: lambda content: Chunk.read(_stream(content)),
    Opcode.ATTACHMENT: lambda content: Attachment.read(_stream(content)),
    Opcode.METADATA: lambda content: Metadata.read(_stream(content)),
    Opcode.FOOTER: lambda content: Footer.read(_stream(content)),
}
"""Records that are read; indexes, offsets and statistics are skipped."""


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


@dataclass(slots=True)
class SalvageReport:
    """The parts of a file that could not be read; valid once its records have been read to the end."""

    closed: bool = False
    """The file was closed properly: its footer is complete."""
    altered: bool = False
    """The content does not match its checksum: bad memory, a bad disk, or a change by somebody. Known for closed files only. It
    hides no message by itself: chunks have checksums of their own, and one that is no chunk any more is a damaged record."""
    torn_bytes: int = 0
    """Number of bytes after the last complete record."""
    damaged_records: int = 0
    """Number of complete records, mostly chunks, that cannot be decoded."""
    unreadable_messages: int = 0
    """Number of messages whose channel was in a damaged chunk, or whose content does not match their schema."""


class NotMcapError(RecordingError):
    """A file can be read, and is none of MCAP."""


def describe_losses(report: SalvageReport) -> list[str]:
    """Return a phrase for each kind of loss; none for a complete file."""
    phrases = {
        "not closed: incomplete, or still being written": not report.closed,
        "CHECKSUM WRONG: the content was altered": report.altered,
        f"{report.torn_bytes} bytes of an incomplete end": report.torn_bytes,
        f"{counted(report.damaged_records, 'damaged record')} left out": report.damaged_records,
        f"{counted(report.unreadable_messages, 'message')} unreadable": report.unreadable_messages,
    }
    return [phrase for phrase, occurred in phrases.items() if occurred]


def is_damaged(report: SalvageReport) -> bool:
    """Return whether something was altered or cannot be read; an incomplete end alone is how a running recording looks."""
    return report.altered or may_hide_messages(report)


def may_hide_messages(report: SalvageReport) -> bool:
    """Return whether messages may have been where something cannot be read, an incomplete end apart."""
    return report.damaged_records > 0 or report.unreadable_messages > 0


def sum_losses(losses: Sequence[SalvageReport]) -> SalvageReport:
    """Return the losses of several files together."""
    return SalvageReport(
        closed=all(each.closed for each in losses),
        altered=any(each.altered for each in losses),
        torn_bytes=sum(each.torn_bytes for each in losses),
        damaged_records=sum(each.damaged_records for each in losses),
        unreadable_messages=sum(each.unreadable_messages for each in losses),
    )


def open_mcap(path: Path) -> BinaryIO:
    """Open a file and skip its magic bytes. Raises `RecordingError` where it is not an MCAP file."""
    try:
        file = open_regular(path)
    except OSError as error:
        raise RecordingError(f"{path}: {reason_of(error).lower()}; check the path") from error
    magic = file.read(len(MCAP0_MAGIC))
    if magic == MCAP0_MAGIC:
        return file
    file.close()
    if not magic:
        raise NotMcapError(f"{path}: is empty; choose another recording")
    raise NotMcapError(f"{path}: is not an MCAP file; give one that the gateway wrote")


@contextmanager
def reading_mcap(path: Path) -> Iterator[BinaryIO]:
    """Yield a file behind its magic bytes. Raises `RecordingError` where it is not an MCAP file, or the disk fails meanwhile."""
    with open_mcap(path) as file:
        try:
            yield file
        except OSError as error:
            raise RecordingError(
                f"{path}: {error.strerror}; copy it off this disk with `ddrescue` and try again"
            ) from error


def read_records(
    file: BinaryIO, losses: SalvageReport, is_wanted: Callable[[int, int], bool] = lambda first_ns, last_ns: True
) -> Iterator[McapRecord]:
    """Yield every complete record from here on, those in chunks one by one. Raises `OSError` of the disk.

    Chunks whose first and last time are not wanted are left out.
    """
    size = os.fstat(file.fileno()).st_size
    chunks = ChunkReader(size)
    checksum = zlib.crc32(MCAP0_MAGIC)
    has_definitions = False
    while (frame := next_frame(file, size)) is not None or find_chunk(file, size):
        if frame is None:
            losses.damaged_records += 1
        if losses.damaged_records and not has_definitions:
            yield from _definitions_of_summary(file, size)
            has_definitions = True
        if frame is None:
            continue
        head, opcode, content = frame
        if opcode == Opcode.DATA_END:
            losses.altered = _promised_checksum(content) not in (0, checksum)
        checksum = zlib.crc32(content, zlib.crc32(head, checksum))
        if opcode in PARSERS and (opcode != Opcode.CHUNK or _is_chunk_wanted(content, is_wanted)):
            yield from _parse(opcode, content, chunks, losses)
        if opcode == Opcode.FOOTER:
            break
    losses.closed = frame is not None and file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
    losses.torn_bytes = 0 if losses.closed else size - file.tell()


def _definitions_of_summary(file: BinaryIO, size: int) -> Iterator[McapRecord]:
    """Yield the schemas and channels at the end of a closed file, for one whose chunks that have them too may be damaged."""
    place = file.tell()
    file.seek(max(0, size - FOOTER.size - len(MCAP0_MAGIC)))
    end = file.read()
    if end.endswith(MCAP0_MAGIC) and len(end) == FOOTER.size + len(MCAP0_MAGIC):
        opcode, length, start, _, checksum = FOOTER.unpack(end[: FOOTER.size])
        section_bytes = size - len(end) - start
        if (opcode, length) == (Opcode.FOOTER, FOOTER_BYTES) and start and 0 < section_bytes <= MAX_RECORD_BYTES:
            file.seek(start)
            section = file.read(section_bytes)
            if checksum == zlib.crc32(end[: FOOTER.size - 4], zlib.crc32(section)):
                yield from _definitions(section)
    file.seek(place)


def _definitions(section: bytes) -> Iterator[McapRecord]:
    with suppress(*DAMAGED):
        for opcode, content in records_of(section):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                yield PARSERS[opcode](content)


def _is_chunk_wanted(content: bytes, is_wanted: Callable[[int, int], bool]) -> bool:
    return len(content) < CHUNK_TIMES.size or is_wanted(*CHUNK_TIMES.unpack_from(content))


def _promised_checksum(content: bytes) -> int:
    """Return the checksum of all records before, from the record at the end of the data; 0: the writer made none."""
    return int.from_bytes(content[:4], "little")


def _parse(opcode: int, content: bytes, chunks: ChunkReader, losses: SalvageReport) -> Iterator[McapRecord]:
    try:
        record = PARSERS[opcode](content)
        if not isinstance(record, Chunk):
            yield record
            return
        for opcode_inside, content_inside in chunks.frames(record):
            yield PARSERS[opcode_inside](content_inside)
    except DAMAGED:
        losses.damaged_records += 1
