"""The writing half of the MCAP format, as far as recordings need it: zstd chunks with indexes, statistics and checksums.

The `mcap` package defines the records. Its own writer serialises each field of a message by a call of its own, which costs more
than everything else in recording; here a message is one `struct` and its payload.

The summary section is made from the records before: by the writer, and again by the verification, from what is signed.
"""

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from gateway.recording.format.frames import FOOTER_BYTES

FOOTER = struct.Struct("<BQQQ")
"""Opcode, length, start of the summary and of the summary offsets: what the summary's checksum contains of the footer."""
CHUNK_BYTES = 1024 * 1024
"""A chunk ends when it is longer than this. Basis: a sample takes 19 bytes at 125 Hz, and 32 in chunks of a second; a reader
decompresses a whole chunk."""
CHUNKS_WITH_DEFINITIONS = 2
"""So many chunks at the beginning have all schemas and channels: one of them may be damaged."""
MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time."""
MESSAGE_FIELDS_BYTES = MESSAGE.size - 9
"""Bytes of a message record after opcode and length, without its payload. Definition: opcode and length take nine bytes
(MCAP)."""
INDEX = struct.Struct("<BQHI")
"""Opcode, length, channel, bytes of the entries."""
FAST = zstandard.ZstdCompressionParameters.from_level(1)
"""Compression of chunks of a second, which a higher level does not make smaller."""
DENSE = zstandard.ZstdCompressionParameters.from_level(9, source_size=CHUNK_BYTES, min_match=7)
"""Compression of long chunks. Shorter matches are coincidences in the digits of noise, and cost more than the digits. Basis: a
choice; lower levels leave larger segments, and higher ones take more of a small board's core."""


class SummarySection:
    """Takes the records of the data section in their order."""

    def __init__(self) -> None:
        self.schemas: list[Schema] = []
        self.channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        """Number of messages by channel."""

    @property
    def chunk_count(self) -> int:
        """Number of chunks."""
        return len(self._chunks)

    def add_metadata(self, record: Metadata, offset: int, length: int) -> None:
        """Add the record of a length at a place."""
        self._metadata.append(MetadataIndex(offset=offset, length=length, name=record.name))

    def add_attachment(self, record: Attachment, offset: int, length: int) -> None:
        """Add the record of a length at a place."""
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                log_time=record.log_time,
                create_time=record.create_time,
                data_size=len(record.data),
                name=record.name,
                media_type=record.media_type,
            )
        )

    def add_chunk(self, record: Chunk, offset: int, length: int) -> None:
        """Add the record of a length at a place; its message indexes follow."""
        self._chunks.append(
            ChunkIndex(
                message_start_time=record.message_start_time,
                message_end_time=record.message_end_time,
                chunk_start_offset=offset,
                chunk_length=length,
                message_index_offsets={},
                message_index_length=0,
                compression=record.compression,
                compressed_size=len(record.data),
                uncompressed_size=record.uncompressed_size,
            )
        )

    def add_message_index(self, channel_id: int, count: int, offset: int, length: int) -> None:
        """Add the index of the messages of a channel in the last chunk."""
        chunk = self._chunks[-1]
        chunk.message_index_offsets[channel_id] = offset
        chunk.message_index_length += length
        self._counts[channel_id] += count

    def encode(self, start: int) -> bytes:
        """Return the section, which starts at this place, and the footer."""
        groups: tuple[tuple[Opcode, Sequence[McapRecord]], ...] = (
            (Opcode.SCHEMA, self.schemas),
            (Opcode.CHANNEL, self.channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary, offsets = b"", b""
        for opcode, records in groups:
            group = serialise(*records)
            place = start + len(summary)
            offsets += serialise(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(group)))
            summary += group
        offset_start = start + len(summary)
        checked = summary + offsets + FOOTER.pack(Opcode.FOOTER, FOOTER_BYTES, start, offset_start)
        return summary + offsets + serialise(Footer(start, offset_start, zlib.crc32(checked)))

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self.channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=max((index.message_end_time for index in self._chunks), default=0),
            message_start_time=min((index.message_start_time for index in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self.schemas),
        )


def serialise(*records: McapRecord) -> bytes:
    """Return records as bytes."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()
    return data


class ByteSink(Protocol):
    """Where the file goes."""

    def write(self, data: bytes) -> int:
        """Append data."""
        ...

    def tell(self) -> int:
        """Return the number of bytes so far."""
        ...


class McapWriter:
    """Writes one MCAP file. A chunk is in the sink after `flush`."""

    def __init__(
        self,
        sink: ByteSink,
        compression: zstandard.ZstdCompressionParameters = FAST,
        *,
        defines_before_chunks: bool = False,
    ) -> None:
        """`defines_before_chunks`: for a file whose topics are not known at its start, of which a reader may skip chunks."""
        self._sink = sink
        self._defines_before_chunks = defines_before_chunks
        self._compressor = zstandard.ZstdCompressor(compression_params=compression)
        self._crc = 0
        """Checksum of the data section."""
        self._chunk = bytearray()
        self._entries: defaultdict[int, list[tuple[int, int]]] = defaultdict(list)
        """Log time and offset of each message in the open chunk, by channel."""
        self._summary = SummarySection()
        """What is written behind the data; it does not know the open chunk."""

    def start(self, profile: str, library: str) -> None:
        """Write the magic bytes and the header."""
        self._write(MCAP0_MAGIC)
        self._write(serialise(Header(profile, library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema to the open chunk, or before it; return its id."""
        schema = Schema(id=len(self._summary.schemas) + 1, data=data, encoding=encoding, name=name)
        self._summary.schemas.append(schema)
        self._define(schema)
        return schema.id

    def register_channel(
        self, topic: str, message_encoding: str, schema_id: int, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Add a channel to the open chunk, or before it; return its id."""
        channel = Channel(
            id=(len(self._summary.channels) + 1) & 0xFFFF,  # 0 is an id too, and so the 65536th
            topic=topic,
            message_encoding=message_encoding,
            metadata=dict(metadata or {}),
            schema_id=schema_id,
        )
        self._summary.channels.append(channel)
        self._define(channel)
        return channel.id

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record."""
        offset = self._sink.tell()
        metadata = Metadata(name=name, metadata=dict(data))
        record = serialise(metadata)
        self._summary.add_metadata(metadata, offset, len(record))
        self._write(record)

    def add_attachment(self, *, create_time: int, log_time: int, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        offset = self._sink.tell()
        attachment = Attachment(create_time=create_time, log_time=log_time, name=name, media_type=media_type, data=data)
        record = serialise(attachment)
        self._summary.add_attachment(attachment, offset, len(record))
        self._write(record)

    def add_message(self, channel_id: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message to the open chunk."""
        chunk = self._chunk
        self._entries[channel_id].append((log_time, len(chunk)))
        length = MESSAGE_FIELDS_BYTES + len(data)
        chunk += MESSAGE.pack(Opcode.MESSAGE, length, channel_id, sequence, log_time, publish_time)
        chunk += data
        if len(chunk) > CHUNK_BYTES:
            self.flush()

    def flush(self) -> None:
        """End the open chunk, unless it is without messages, and write it with its message indexes."""
        if not self._entries:
            return
        chunk_data, entries = bytes(self._chunk), self._entries
        self._chunk, self._entries = bytearray(), defaultdict(list)
        times = [log_time for of_channel in entries.values() for log_time, _ in of_channel]
        chunk = Chunk(
            compression="zstd",
            data=self._compressor.compress(chunk_data),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(chunk_data),
            uncompressed_size=len(chunk_data),
        )
        chunk_offset = self._sink.tell()
        record = serialise(chunk)
        self._summary.add_chunk(chunk, chunk_offset, len(record))
        self._write(record)
        for channel_id, of_channel in entries.items():
            index = _message_index(channel_id, of_channel)
            self._summary.add_message_index(channel_id, len(of_channel), self._sink.tell(), len(index))
            self._write(index)
        if self._summary.chunk_count < CHUNKS_WITH_DEFINITIONS:
            self._chunk += serialise(*self._summary.schemas, *self._summary.channels)

    def finish(self) -> None:
        """Write the summary and the footer."""
        self.flush()
        self._write(serialise(DataEnd(self._crc)))
        self._sink.write(self._summary.encode(self._sink.tell()))
        self._sink.write(MCAP0_MAGIC)

    def _define(self, record: Schema | Channel) -> None:
        if self._defines_before_chunks:
            self._write(serialise(record))
        else:
            self._chunk += serialise(record)

    def _write(self, data: bytes) -> None:
        """Write a part of the data section."""
        self._crc = zlib.crc32(data, self._crc)
        self._sink.write(data)


def _message_index(channel_id: int, entries: Sequence[tuple[int, int]]) -> bytes:
    """Return the index of the messages of a channel in a chunk: log time and offset of each."""
    numbers = [number for entry in entries for number in entry]
    n_bytes = 8 * len(numbers)
    return INDEX.pack(Opcode.MESSAGE_INDEX, 6 + n_bytes, channel_id, n_bytes) + struct.pack(
        f"<{len(numbers)}Q", *numbers
    )
