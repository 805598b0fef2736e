"""The records in the chunks of an MCAP file, bounded in memory and time whatever the file claims.

Sensor data compress to a tenth, zeros to a thirty-thousandth: without limits a file of 131 kB became 4 GB.
"""

import zlib
from collections.abc import Iterator
from io import BytesIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk

from gateway.recording.mcap_frames import RECORD_HEAD

MAX_CHUNK_BYTES = 64_000_000
"""Largest chunk, without compression. Basis: writers make chunks of 1 to 4 MB; one message may be as large as a photograph."""
MAX_EXPANSION = 200
"""Largest ratio of all chunks of a file to its size, beside one largest chunk. Basis: recordings of a crane at rest reach 12."""
MAX_WINDOW_BYTES = 1 << 27
IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


class ChunkError(ValueError):
    """A chunk cannot be read: it is damaged, or larger than the limits."""


class ChunkReader:
    """Decompresses the chunks of one file, within limits for each and for all together."""

    def __init__(self, file_bytes: int) -> None:
        self._remaining_bytes = MAX_CHUNK_BYTES + MAX_EXPANSION * file_bytes

    def frames(self, chunk: Chunk) -> Iterator[tuple[int, bytes]]:
        """Return opcode and content of each schema, channel and message of a chunk, which is checked before the first one.

        Raises `ChunkError`.
        """
        data = self._decompress(chunk)
        if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise ChunkError("the checksum is wrong")
        _check_frames(data)
        return _frames(data)

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


def _check_frames(data: bytes) -> None:
    """Raise `ChunkError` where the lengths of the records do not add up, or something is no record."""
    place = 0
    while place < len(data):
        if place + RECORD_HEAD.size > len(data):
            raise ChunkError("the last record is incomplete")
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place += RECORD_HEAD.size + length
        if opcode == 0 or place > len(data):
            raise ChunkError("a record is none, or is longer than its chunk")


def _frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    place = 0
    while place < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, place)
        place += RECORD_HEAD.size
        if opcode in IN_CHUNKS:
            yield opcode, data[place : place + length]
        place += length
