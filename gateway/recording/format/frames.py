"""The records of an MCAP file and of its chunks as opcode and content, found again behind damage.

The length of a record is not protected by a checksum. Where it is wrong, the next chunk is found by its signature: the name of
its compression, at a fixed distance from its start.

Chunks are bounded in memory and time whatever the file claims. Sensor data compress to a tenth, zeros to a thirty-thousandth:
without limits a file of 131 kB became 4 GB.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length before the content of each record."""
CHUNK_HEAD = struct.Struct("<QQQI8sQ")
"""First and last time, size, checksum, compression with its length, and length of the records of a chunk."""
SIGNATURE = b"\x04\x00\x00\x00zstd"
SIGNATURE_PLACE = RECORD_HEAD.size + 28
"""Distance of the signature from the start of a chunk record. Definition: the fields of an MCAP chunk before its records."""
INDEX_HEAD = struct.Struct("<HI")
"""Channel, and length of the entries, of a message index."""
TIME_AND_OFFSET_BYTES = 16
"""Definition: an entry of a message index (MCAP)."""
FOOTER_BYTES = 20
"""Definition: the content of a footer record (MCAP)."""
SEARCH_BYTES = 1024 * 1024
"""Bytes that are searched at once. Basis: a choice; more does not read faster, and a small board has the memory."""

Frame = tuple[bytes, int, bytes]
"""Head, opcode and content of a record."""
MAX_CHUNK_BYTES = 64_000_000
"""Largest chunk, without compression. Basis: writers make chunks of 1 to 4 MB; one message may be as large as a photograph."""
MAX_RECORD_BYTES = MAX_CHUNK_BYTES
"""Largest record that is read. Basis: a chunk that was not compressed."""
MAX_EXPANSION = 30
"""Largest ratio of all chunks of a file to its size, beside one largest chunk. Basis: recordings of a crane at rest reach 12, and
more costs more than ten seconds for 10 MB."""
MIN_RECORDS = 100_000
"""So many records are read of every file. Basis: a choice; the channels of any file fit, and they cost less than a second."""
BYTES_PER_RECORD = 40
"""One more record is read for each of so many bytes of a file. Basis: those of a crane at rest have 50 bytes for each message;
more records cost more than ten seconds for 10 MB."""
MAX_WINDOW_BYTES = 1 << 27
"""Largest window of the decompression. Basis: a choice; the window of zstd's level 22 is as large, and a hostile file asks for no
more."""
IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


def next_frame(file: BinaryIO, size: int) -> Frame | None:
    """Return the next record; None, at an unchanged position, if it is incomplete or damaged."""
    place = file.tell()
    head = file.read(RECORD_HEAD.size)
    if len(head) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        if opcode != 0 and length <= min(
            MAX_RECORD_BYTES, size - file.tell()
        ):  # 0 is not an opcode: some file systems leave zeros
            content = file.read(length)
            if _is_plausible(opcode, content):
                return head, opcode, content
    file.seek(place)
    return None


def find_chunk(file: BinaryIO, size: int) -> bool:
    """Go to the start of the next complete chunk behind this position; return whether there is one, else stay."""
    begin = file.tell()
    place = begin + 1
    while place + SIGNATURE_PLACE < size:
        file.seek(place)
        window = file.read(SEARCH_BYTES + SIGNATURE_PLACE + len(SIGNATURE))
        for start in _signatures(window):
            file.seek(place + start)
            if (frame := next_frame(file, size)) is not None and frame[1] == Opcode.CHUNK:
                file.seek(place + start)
                return True
        place += SEARCH_BYTES
    file.seek(begin)
    return False


def _signatures(window: bytes) -> Iterator[int]:
    """Yield the starts of the records whose signatures are in a window."""
    found = window.find(SIGNATURE, SIGNATURE_PLACE)
    while found >= 0:
        yield found - SIGNATURE_PLACE
        found = window.find(SIGNATURE, found + 1)


def _is_plausible(opcode: int, content: bytes) -> bool:
    """Return whether the length of a record agrees with its content, so that it hides no record after it."""
    if opcode == Opcode.CHUNK and content[28 : 28 + len(SIGNATURE)] == SIGNATURE:
        return len(content) >= CHUNK_HEAD.size and len(content) == CHUNK_HEAD.size + CHUNK_HEAD.unpack_from(content)[-1]
    if opcode == Opcode.MESSAGE_INDEX:
        return len(content) >= INDEX_HEAD.size and len(content) == INDEX_HEAD.size + INDEX_HEAD.unpack_from(content)[-1]
    return opcode in (Opcode.MESSAGE, Opcode.CHUNK_INDEX) or SIGNATURE not in content


class ChunkError(ValueError):
    """A chunk cannot be read: it is damaged, or larger than the limits."""


class ChunkReader:
    """Decompresses the chunks of one file, within limits for each and for all together."""

    def __init__(self, file_bytes: int) -> None:
        self._remaining_bytes = MAX_CHUNK_BYTES + MAX_EXPANSION * file_bytes
        self._remaining_records = MIN_RECORDS + file_bytes // BYTES_PER_RECORD

    def frames(self, chunk: Chunk) -> Iterator[tuple[int, bytes]]:
        """Return opcode and content of each schema, channel and message of a chunk, which is checked before the first one.

        Raises `ChunkError`.
        """
        data = self._decompress(chunk)
        if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise ChunkError("the checksum is wrong")
        self._remaining_records -= count_records(data, self._remaining_records)
        return (frame for frame in records_of(data) if frame[0] in IN_CHUNKS)

    def _decompress(self, chunk: Chunk) -> bytes:
        size = chunk.uncompressed_size
        if size > min(MAX_CHUNK_BYTES, self._remaining_bytes):
            raise ChunkError(f"a chunk of {size} bytes is larger than any that is read")
        self._remaining_bytes -= size
        match chunk.compression:
            case "":
                data = chunk.data
            case "zstd":
                reader = zstandard.ZstdDecompressor(max_window_size=MAX_WINDOW_BYTES)
                with reader.stream_reader(BytesIO(chunk.data)) as stream:
                    data = stream.read(size + 1)
            case "lz4":
                data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
            case other:
                raise ChunkError(f"compression {other!r} is not known")
        if len(data) != size:
            raise ChunkError(f"a chunk has not the {size} bytes that it claims")
        return bytes(data)


def count_records(data: bytes, most: int) -> int:
    """Return the number of records. Raises `ChunkError` where their lengths do not add up, or there are more."""
    place = count = 0
    while place < len(data):
        if place + RECORD_HEAD.size > len(data):
            raise ChunkError("the last record is incomplete")
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place += RECORD_HEAD.size + length
        count += 1
        if opcode == 0 or place > len(data):
            raise ChunkError("a record is none, or is longer than its chunk")
        if count > most:
            raise ChunkError("the file has more records than are read of one of its size")
    return count


def records_of(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record. Raises `struct.error` where the last one is incomplete."""
    place = 0
    while place < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place += RECORD_HEAD.size
        yield opcode, data[place : place + length]
        place += length
