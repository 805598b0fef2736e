"""The summary section of an MCAP file: schemas, channels, statistics and indexes, all of them made from the records before.

The writer makes it, and the verification makes it again from what is signed.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Sequence

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from gateway.recording.format.frames import FOOTER_BYTES

FOOTER = struct.Struct("<BQQQ")
"""Opcode, length, start of the summary and of the summary offsets: what the summary's checksum contains of the footer."""


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
