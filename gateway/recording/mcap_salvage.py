"""Records of an MCAP file as far as they are whole: what a power cut, a full disk or a bad sector left.

The readers of the `mcap` package give nothing, or an exception of some kind, for a torn file. This one frames the records by
their lengths, stops at the tear, skips what is damaged, and counts both.
"""

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from devices.errors import RecordingError

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length, before each record's content."""
DAMAGED = (McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError, MemoryError, OverflowError)
"""What the package raises for content that is not what its length promised: RuntimeError is lz4's."""
PARSERS: dict[int, Callable[[bytes], McapRecord]] = {
    Opcode.HEADER: lambda content: Header.read(_stream(content)),
    Opcode.SCHEMA: lambda content: Schema.read(_stream(content)),
    Opcode.CHANNEL: lambda content: Channel.read(_stream(content)),
    Opcode.MESSAGE: lambda content: Message.read(_stream(content), len(content)),
    Opcode.CHUNK: lambda content: Chunk.read(_stream(content)),
    Opcode.ATTACHMENT: lambda content: Attachment.read(_stream(content)),
    Opcode.METADATA: lambda content: Metadata.read(_stream(content)),
    Opcode.FOOTER: lambda content: Footer.read(_stream(content)),
}
"""Records worth reading; indexes, offsets and statistics are passed over."""


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


@dataclass(slots=True)
class SalvageReport:
    """What of a file could not be read; complete once its records have been read to the end."""

    closed: bool = False
    """The file was ended properly: its footer stands where it belongs."""
    altered: bool = False
    """The content is not what its checksum promises: bad memory or disk, or somebody changed it. Known for closed files only."""
    torn_bytes: int = 0
    """Bytes behind the last whole record."""
    damaged_records: int = 0
    """Records (chunks, mostly) that are there and make no sense."""
    unreadable_messages: int = 0
    """Messages whose channel was in a damaged chunk, or which are not the JSON that they should be."""


def open_mcap(path: Path) -> BinaryIO:
    """The file, behind its magic bytes. Raises `RecordingError` where it is no MCAP file."""
    try:
        file = path.open("rb")
    except OSError as error:
        raise RecordingError(f"{path}: {(error.strerror or str(error)).lower()}; check the path") from error
    magic = file.read(len(MCAP0_MAGIC))
    if magic == MCAP0_MAGIC:
        return file
    file.close()
    if not magic:
        raise RecordingError(f"{path}: is empty; choose another recording")
    raise RecordingError(f"{path}: is not an MCAP file; give one that the gateway wrote, or a .csv")


def records(file: BinaryIO, losses: SalvageReport) -> Iterator[McapRecord]:
    """Every whole record from here on, those in chunks one by one. Raises `OSError` of the disk."""
    size = os.fstat(file.fileno()).st_size
    checksum = zlib.crc32(MCAP0_MAGIC)
    while (frame := _next_frame(file, size)) is not None:
        head, opcode, content = frame
        if opcode == Opcode.DATA_END:
            losses.altered = _promised_checksum(content) not in (0, checksum)
        checksum = zlib.crc32(content, zlib.crc32(head, checksum))
        if opcode in PARSERS:
            yield from _parsed(opcode, content, losses)
        if opcode == Opcode.FOOTER:
            break
    losses.closed = frame is not None and file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
    losses.torn_bytes = 0 if losses.closed else size - file.tell()


def _next_frame(file: BinaryIO, size: int) -> tuple[bytes, int, bytes] | None:
    """Head, opcode and content of the record that begins here; None, and the file stays here, where it is not whole."""
    place = file.tell()
    head = file.read(RECORD_HEAD.size)
    if len(head) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        if opcode != 0 and length <= size - file.tell():  # 0 is no opcode: the zeros that some file systems leave
            return head, opcode, file.read(length)
    file.seek(place)
    return None


def _promised_checksum(content: bytes) -> int:
    """Checksum of all before, as the record at the end of the data gives it; 0: the writer made none."""
    return int.from_bytes(content[:4], "little")


def _parsed(opcode: int, content: bytes, losses: SalvageReport) -> list[McapRecord]:
    try:
        record = PARSERS[opcode](content)
        return breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
    except DAMAGED:
        losses.damaged_records += 1
        return []
