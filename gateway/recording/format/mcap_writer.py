"""The writing half of the MCAP format, as far as recordings need it: zstd chunks with indexes, statistics and checksums.

The `mcap` package defines the records. Its own writer serialises each field of a message by a call of its own, which costs more
than everything else in recording; here a message is one `struct` and its payload.
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
CHECKED_FOOTER = struct.Struct("<BQQQ")
"""Opcode, length, start of the summary and of the summary offsets: what the summary's checksum contains of the footer."""

FAST = zstandard.ZstdCompressionParameters.from_level(1)
"""Compression of chunks of a second, which a higher level does not make smaller."""
DENSE = zstandard.ZstdCompressionParameters.from_level(9, source_size=CHUNK_BYTES, min_match=7)
"""Compression of long chunks. Shorter matches are coincidences in the digits of noise, and cost more than the digits. Basis: a
choice; lower levels leave larger segments, and higher ones take more of a small board's core."""


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

    def __init__(self, sink: ByteSink, compression: zstandard.ZstdCompressionParameters = FAST) -> None:
        self._sink = sink
        self._compressor = zstandard.ZstdCompressor(compression_params=compression)
        self._crc = 0
        """Checksum of the data section."""
        self._chunk = bytearray()
        self._entries: defaultdict[int, list[tuple[int, int]]] = defaultdict(list)
        """Log time and offset of each message in the open chunk, by channel."""
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunk_indexes: list[ChunkIndex] = []
        self._attachment_indexes: list[AttachmentIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        """Number of messages by channel, without the open chunk."""

    def start(self, profile: str, library: str) -> None:
        """Write the magic bytes and the header."""
        self._write(MCAP0_MAGIC)
        self._write(_serialise(Header(profile, library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema to the open chunk; return its id."""
        schema = Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._chunk += _serialise(schema)
        return schema.id

    def register_channel(
        self, topic: str, message_encoding: str, schema_id: int, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Add a channel to the open chunk; return its id."""
        channel = Channel(
            id=(len(self._channels) + 1) & 0xFFFF,  # 0 is an id too, and so the 65536th
            topic=topic,
            message_encoding=message_encoding,
            metadata=dict(metadata or {}),
            schema_id=schema_id,
        )
        self._channels.append(channel)
        self._chunk += _serialise(channel)
        return channel.id

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record."""
        offset = self._sink.tell()
        record = _serialise(Metadata(name=name, metadata=dict(data)))
        self._metadata_indexes.append(MetadataIndex(offset=offset, length=len(record), name=name))
        self._write(record)

    def add_attachment(self, *, create_time: int, log_time: int, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        offset = self._sink.tell()
        attachment = Attachment(create_time=create_time, log_time=log_time, name=name, media_type=media_type, data=data)
        record = _serialise(attachment)
        index = AttachmentIndex(
            offset=offset,
            length=len(record),
            log_time=log_time,
            create_time=create_time,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._attachment_indexes.append(index)
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
        self._write(_serialise(chunk))
        index_offset = self._sink.tell()
        offsets = {}
        for channel_id, of_channel in entries.items():
            offsets[channel_id] = self._sink.tell()
            self._write(_message_index(channel_id, of_channel))
            self._counts[channel_id] += len(of_channel)
        index = ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=chunk_offset,
            chunk_length=index_offset - chunk_offset,
            message_index_offsets=offsets,
            message_index_length=self._sink.tell() - index_offset,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        self._chunk_indexes.append(index)
        if len(self._chunk_indexes) < CHUNKS_WITH_DEFINITIONS:
            self._chunk += _serialise(*self._schemas, *self._channels)

    def finish(self) -> None:
        """Write the summary and the footer."""
        self.flush()
        self._write(_serialise(DataEnd(self._crc)))
        summary_start = self._sink.tell()
        groups: tuple[tuple[Opcode, Sequence[McapRecord]], ...] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, self._attachment_indexes),
            (Opcode.METADATA_INDEX, self._metadata_indexes),
        )
        summary, offsets = b"", b""
        for opcode, records in groups:
            group = _serialise(*records)
            start = summary_start + len(summary)
            offsets += _serialise(SummaryOffset(group_opcode=opcode, group_start=start, group_length=len(group)))
            summary += group
        offset_start = summary_start + len(summary)
        checked = summary + offsets + CHECKED_FOOTER.pack(Opcode.FOOTER, FOOTER_BYTES, summary_start, offset_start)
        self._sink.write(summary + offsets)
        self._sink.write(_serialise(Footer(summary_start, offset_start, zlib.crc32(checked))))
        self._sink.write(MCAP0_MAGIC)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachment_indexes),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunk_indexes),
            message_count=self._counts.total(),
            message_end_time=max((index.message_end_time for index in self._chunk_indexes), default=0),
            message_start_time=min((index.message_start_time for index in self._chunk_indexes), default=0),
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )

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


def _serialise(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()
    return data
