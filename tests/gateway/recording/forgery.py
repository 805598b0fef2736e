"""Forgeries of a signed recording by somebody who may write to it and has no key; all checksums are right."""

import re
import struct
import zlib
from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Message,
    Metadata,
    MetadataIndex,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

from gateway.recording.chain.file_verification import RecomputedSummary
from gateway.recording.format.content import ORIGIN
from gateway.recording.format.frames import next_frame
from gateway.recording.format.mcap_writer import serialise
from gateway.recording.format.segment_summary import SUMMARY
from gateway.recording.reading.recording_file import read_index

HEAD = struct.Struct("<BQ")
FORGED_LOG_COUNT = 77
Record = tuple[int, bytes]
"""Opcode, and the whole record."""
Change = Callable[[list[Record], int], tuple[list[Record], bytes]]
"""Takes the records of the end and the place where they begin; returns others, and bytes that are put before them."""


def records(content: bytes, place: int = len(MCAP0_MAGIC)) -> Iterable[tuple[int, int, bytes]]:
    """Place, opcode and bytes of each record from a place on."""
    while place + HEAD.size <= len(content) - len(MCAP0_MAGIC):
        opcode, length = HEAD.unpack_from(content, place)
        yield place, opcode, content[place : place + HEAD.size + length]
        place += HEAD.size + length


def data_end(content: bytes) -> int:
    """The place of the record at the end of the data."""
    return next(place for place, opcode, _ in records(content) if opcode == Opcode.DATA_END)


def with_end(path: Path, change: Change) -> None:
    """Put another end behind the signed bytes, closed with the right checksums."""
    content = path.read_bytes()
    end = data_end(content)
    start = end + len(serialise(DataEnd(0)))
    found = [
        (opcode, record)
        for _, opcode, record in records(content, start)
        if opcode not in (Opcode.FOOTER, Opcode.SUMMARY_OFFSET)
    ]
    changed, inserted = change(found, start)
    summary_start = start + len(inserted)
    summary = b"".join(record for _, record in changed)
    footer = serialise(Footer(summary_start, 0, 0))
    checked = zlib.crc32(footer[: HEAD.size + 16], zlib.crc32(summary))
    path.write_bytes(content[:start] + inserted + summary + serialise(Footer(summary_start, 0, checked)) + MCAP0_MAGIC)


def renumbered(number: int) -> Change:
    """The metadata of the origin with another number."""

    def change(found: list[Record], place: int) -> tuple[list[Record], bytes]:
        record = serialise(Metadata(ORIGIN, {"segment": str(number)}))
        index = serialise(MetadataIndex(place, len(record), ORIGIN))
        return [*found, (Opcode.METADATA_INDEX, index)], record

    return change


def summarised(path: Path) -> Change:
    """A summary of the segment that says something else."""
    content = path.read_bytes()
    (said,) = (
        Attachment.read(stream(record[HEAD.size :])).data
        for _, opcode, record in records(content)
        if opcode == Opcode.ATTACHMENT and SUMMARY.encode() in record[:200]
    )
    forged = re.sub(rb'"log_count":\d+', f'"log_count":{FORGED_LOG_COUNT}'.encode(), said)

    def change(found: list[Record], place: int) -> tuple[list[Record], bytes]:
        record = serialise(Attachment(0, 0, SUMMARY, "application/json", forged))
        index = serialise(AttachmentIndex(place, len(record), 0, 0, len(forged), SUMMARY, "application/json"))
        others = [each for each in found if not (each[0] == Opcode.ATTACHMENT_INDEX and SUMMARY.encode() in each[1])]
        return [*others, (Opcode.ATTACHMENT_INDEX, index)], record

    return change


def retimed(shift_ns: int) -> Change:
    """Statistics that put the messages at another time."""

    def change(found: list[Record], _: int) -> tuple[list[Record], bytes]:
        changed = []
        for opcode, record in found:
            if opcode == Opcode.STATISTICS:
                said = Statistics.read(stream(record[HEAD.size :]))
                said.message_start_time += shift_ns
                said.message_end_time += shift_ns
                changed.append((opcode, serialise(said)))
            else:
                changed.append((opcode, record))
        return changed, b""

    return change


def rechannelled(found: list[Record], _: int) -> tuple[list[Record], bytes]:
    """Channels of which the alerts have another name."""
    changed = []
    for opcode, record in found:
        if opcode == Opcode.CHANNEL and b"/alert" in record:
            said = Channel.read(stream(record[HEAD.size :]))
            said.topic = "/other"
            changed.append((opcode, serialise(said)))
        else:
            changed.append((opcode, record))
    return changed, b""


def with_chunk(content: bytes, time_ns: int) -> bytes:
    """An incomplete file with one more message behind its last record."""
    data = serialise(Message(1, time_ns, b"{}", time_ns, 0))
    packed = zstandard.ZstdCompressor().compress(data)
    return content + serialise(Chunk("zstd", packed, time_ns, time_ns, zlib.crc32(data), len(data)))


def cut_behind_first_signature(content: bytes) -> bytes:
    """The file as it was when it began."""
    for place, opcode, record in records(content):
        if opcode == Opcode.METADATA and record[HEAD.size + 4 :].startswith(b"signature"):
            return content[: place + len(record)]
    raise AssertionError("no signature")


def cut_behind_last_checkpoint(content: bytes) -> bytes:
    """A closed file as it was when it was signed for the last time before that."""
    ends = [
        place + len(record)
        for place, opcode, record in records(content)
        if opcode == Opcode.METADATA and record[HEAD.size + 4 :].startswith(b"signature")
    ]
    return content[: ends[-2]]


def closed(content: bytes) -> bytes:
    """A file that was being written, with the end that a closed one has."""
    section, stream = RecomputedSummary(len(content)), BytesIO(content)
    stream.seek(len(MCAP0_MAGIC))
    while stream.tell() < len(content):
        place = stream.tell()
        frame = next_frame(stream, len(content))
        assert frame is not None
        section.observe(frame, place)
    end = serialise(DataEnd(zlib.crc32(content)))
    return content + end + section.end(len(content) + len(end), b"")


def newest_ns(path: Path) -> int:
    """The time of the newest message."""
    return read_index(path).to_ns


def stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
