"""Decoding of the ADXL355's FIFO.

It holds 96 entries of 3 bytes, one per axis in the order x y z: 20 bits of two's complement, left-justified and big-endian. The
two lowest bits of an entry mark an x entry and an empty FIFO.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ENTRY_BYTES, SAMPLE_BYTES = 3, 9
"""Definition: an entry has an axis of 20 bits, a sample three of them (data sheet)."""
FIFO_ENTRIES = 96
"""Data sheet: 96 entries, 32 samples."""

MARKS = bytes(b"oxee"[byte & 3] for byte in range(256))
"""Kind of an entry by its third byte: x, another axis, empty."""
EMPTY = ord("e")
ALIGNED = b"xoo" * FIFO_ENTRIES
SEGMENTS = re.compile(rb"(?P<whole>(?:xoo)+)|(?P<tail>xo?\Z)|(?P<broken>[xo]o*)")
"""Complete samples; an incomplete sample at the end; entries of a sample that lacks others."""


@dataclass(frozen=True, slots=True)
class EntryRun:
    """Complete consecutive samples from the FIFO."""

    entries: bytes
    """9 bytes per sample."""
    lost: int
    """Number of incomplete samples before them."""

    def __len__(self) -> int:
        return len(self.entries) // SAMPLE_BYTES


def split_entries(entries: bytes) -> tuple[list[EntryRun], bytes]:
    """Return the complete samples, and the entries of an incomplete last sample.

    Empty entries are removed; a sample that lacks entries is skipped up to the next x entry.
    """
    marks = entries[2::ENTRY_BYTES].translate(MARKS)
    if ALIGNED.startswith(marks) and len(entries) % SAMPLE_BYTES == 0:
        return [EntryRun(entries, 0)] if entries else [], b""
    filled = b"".join(entries[3 * i : 3 * i + 3] for i, mark in enumerate(marks) if mark != EMPTY)
    runs, tail, lost = [], b"", 0
    for stretch in SEGMENTS.finditer(filled[2::ENTRY_BYTES].translate(MARKS)):
        part = filled[3 * stretch.start() : 3 * stretch.end()]
        if stretch["whole"]:
            runs.append(EntryRun(part, lost))
            lost = 0
        elif stretch["tail"]:
            tail = part
        else:
            lost += 1
    return ([*runs, EntryRun(b"", lost)] if lost else runs), tail


def decode_counts(entries: bytes) -> NDArray[np.int32]:
    """Return the counts of complete samples, shape (n, 3), from 9 n bytes."""
    words = np.zeros((len(entries) // ENTRY_BYTES, 4), dtype=np.uint8)
    words[:, :3] = np.frombuffer(entries, dtype=np.uint8).reshape(-1, ENTRY_BYTES)
    counts: NDArray[np.int32] = words.view(">i4").astype(np.int32).reshape(-1, 3) >> 12
    return counts
