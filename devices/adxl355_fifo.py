"""Decoding of the ADXL355's FIFO.

It holds 96 entries of 3 bytes, one per axis, x y z x y z: 20 bits of two's complement, left-justified and big-endian. The
two lowest bits of an entry say "this is x" and "the FIFO was empty".
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ENTRY_BYTES, SAMPLE_BYTES = 3, 9
FIFO_ENTRIES = 96

MARKS = bytes(b"oxee"[byte & 3] for byte in range(256))
"""What an entry's third byte says it is: x, another axis, empty."""
EMPTY = ord("e")
IN_STEP = b"xoo" * FIFO_ENTRIES
STRETCHES = re.compile(rb"(?P<whole>(?:xoo)+)|(?P<tail>xo?\Z)|(?P<broken>[xo]o*)")
"""Whole samples; a sample whose rest is still to come; entries of a sample that lacks others."""


@dataclass(frozen=True, slots=True)
class Run:
    """Whole samples in a row, as they came from the FIFO."""

    entries: bytes
    """9 bytes per sample."""
    lost: int
    """Samples before them of which only some entries came."""

    def __len__(self) -> int:
        return len(self.entries) // SAMPLE_BYTES


def split_entries(entries: bytes) -> tuple[list[Run], bytes]:
    """FIFO entries as runs of whole samples, and the entries of a last sample that is not complete yet.

    Empty entries are left out; a sample that lacks entries is skipped up to the next x marker.
    """
    marks = entries[2::ENTRY_BYTES].translate(MARKS)
    if IN_STEP.startswith(marks) and len(entries) % SAMPLE_BYTES == 0:
        return [Run(entries, 0)] if entries else [], b""
    filled = b"".join(entries[3 * i : 3 * i + 3] for i, mark in enumerate(marks) if mark != EMPTY)
    runs, tail, lost = [], b"", 0
    for stretch in STRETCHES.finditer(filled[2::ENTRY_BYTES].translate(MARKS)):
        part = filled[3 * stretch.start() : 3 * stretch.end()]
        if stretch["whole"]:
            runs.append(Run(part, lost))
            lost = 0
        elif stretch["tail"]:
            tail = part
        else:
            lost += 1
    return ([*runs, Run(b"", lost)] if lost else runs), tail


def decode_counts(entries: bytes) -> NDArray[np.int32]:
    """Counts of whole samples, shape (n, 3), from 9 n bytes: 20-bit two's complement, left-justified, big-endian."""
    words = np.zeros((len(entries) // ENTRY_BYTES, 4), dtype=np.uint8)
    words[:, :3] = np.frombuffer(entries, dtype=np.uint8).reshape(-1, ENTRY_BYTES)
    counts: NDArray[np.int32] = words.view(">i4").astype(np.int32).reshape(-1, 3) >> 12
    return counts
