"""The records of an MCAP file as opcode and content, found again behind damage.

The length of a record is not protected by a checksum. Where it is wrong, the next chunk is found by its signature: the name of
its compression, at a fixed distance from its start.
"""

import struct
from collections.abc import Iterator
from typing import BinaryIO

from mcap.opcode import Opcode

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length before the content of each record."""
CHUNK_HEAD = struct.Struct("<QQQI8sQ")
"""First and last time, size, checksum, compression with its length, and length of the records of a chunk."""
SIGNATURE = b"\x04\x00\x00\x00zstd"
SIGNATURE_PLACE = RECORD_HEAD.size + 28
"""Distance of the signature from the start of a chunk record."""
INDEX_HEAD = struct.Struct("<HI")
"""Channel, and length of the entries, of a message index."""
SEARCH_BYTES = 1024 * 1024

Frame = tuple[bytes, int, bytes]
"""Head, opcode and content of a record."""


def next_frame(file: BinaryIO, size: int) -> Frame | None:
    """Return the next record; None, at an unchanged position, if it is incomplete or damaged."""
    place = file.tell()
    head = file.read(RECORD_HEAD.size)
    if len(head) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        if opcode != 0 and length <= size - file.tell():  # 0 is not an opcode: some file systems leave zeros
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
