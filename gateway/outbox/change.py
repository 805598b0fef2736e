"""A change of an alert as a line of the outbox: checksum, boot id, number, and the message as it is sent."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

MAX_DIGITS = 18
"""Digits of a number. Basis: Python refuses to read one of thousands; 18 digits fit 64 bits."""


@dataclass(frozen=True, slots=True)
class StoredChange:
    """A change, identified by boot id and number: where the disk had failed, a number can occur in two boots."""

    boot_id: str
    number: int
    payload: bytes
    """The alert message as JSON, in one line."""


def encode_line(change: StoredChange) -> bytes:
    """Return a change as a line. Raises `ValueError` for a boot id or a payload that does not fit on one."""
    if not change.boot_id or " " in change.boot_id or b"\n" in change.payload:
        raise ValueError(f"change {change.number}: boot id {change.boot_id!r} or payload is no part of a line")
    content = b"%s %d %s" % (change.boot_id.encode(), change.number, change.payload)
    return b"%08x %s\n" % (zlib.crc32(content), content)


def parse_line(line: bytes) -> StoredChange | None:
    """Return the change of a line without its line end; None where it is damaged."""
    checksum, _, content = line.partition(b" ")
    if checksum != b"%08x" % zlib.crc32(content):
        return None
    parts = content.split(b" ", 2)
    if len(parts) != 3 or not parts[1].isdigit() or len(parts[1]) > MAX_DIGITS:
        return None
    return StoredChange(parts[0].decode(errors="replace"), int(parts[1]), parts[2])


def parse_lines(content: bytes) -> Iterator[StoredChange]:
    """Yield the readable changes of a file; an incomplete last line is left out."""
    complete, _, _ = content.rpartition(b"\n")
    for line in complete.split(b"\n"):
        change = parse_line(line)
        if change is not None:
            yield change


def readable_size(content: bytes) -> int:
    """Return the number of bytes without an incomplete or damaged end, behind which a line can be appended."""
    size = content.rfind(b"\n") + 1
    while size:
        begin = content.rfind(b"\n", 0, size - 1) + 1
        if parse_line(content[begin : size - 1]) is not None:
            break
        size = begin
    return size
