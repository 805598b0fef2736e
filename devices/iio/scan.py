"""Scans of a Linux IIO buffer: the layout that sysfs states, and the decoding of the bytes.

Kernel documentation, "Industrial I/O", section "Buffers": `_type` is `[be|le]:[s|u]bits/storagebits[Xrepeat][>>shift]`, elements
are in the order of `_index`, each aligned to its own size, and a scan to that of its largest element.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TYPE = re.compile(
    r"(?P<order>le|be):(?P<sign>[su])(?P<bits>\d+)/(?P<storage>\d+)(?:X(?P<repeat>\d+))?(?:>>(?P<shift>\d+))?"
)
STORAGE_BITS = (8, 16, 32, 64)
"""Definition: sizes of an element (Linux, IIO)."""


@dataclass(frozen=True, slots=True)
class ScanType:
    """The format of one element of a scan."""

    is_big_endian: bool
    is_signed: bool
    bits: int
    storage_bits: int
    shift: int

    @classmethod
    def parse(cls, text: str) -> "ScanType":
        """Return the type of a text such as `be:s20/32>>4`. Raises `ValueError`."""
        found = TYPE.fullmatch(text.strip())
        if found is None:
            raise ValueError(f"{text.strip()!r} is no scan type such as 'le:s16/16>>0'")
        bits, storage_bits, shift = int(found["bits"]), int(found["storage"]), int(found["shift"] or 0)
        if storage_bits not in STORAGE_BITS or not 0 < bits <= storage_bits - shift or int(found["repeat"] or 1) != 1:
            raise ValueError(f"scan type {text.strip()!r} is not one number within 8, 16, 32 or 64 bits")
        return cls(found["order"] == "be", found["sign"] == "s", bits, storage_bits, shift)

    @property
    def bytes(self) -> int:
        """Size in the scan."""
        return self.storage_bits // 8

    @property
    def limits(self) -> tuple[int, int]:
        """Lowest and highest number."""
        if self.is_signed:
            return -(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1
        return 0, (1 << self.bits) - 1

    def decode(self, words: NDArray[np.generic]) -> NDArray[np.int64]:
        """Return the numbers in unsigned words of the storage's size; bits outside the number may have any value."""
        unused = 64 - self.bits
        left_justified = words.astype(np.uint64) << np.uint64(unused - self.shift)
        if self.is_signed:
            return np.asarray(left_justified.view(np.int64) >> np.int64(unused), dtype=np.int64)
        return np.asarray((left_justified >> np.uint64(unused)).astype(np.int64), dtype=np.int64)


class ScanLayout:
    """The elements of a scan, by name."""

    def __init__(self, elements: Mapping[str, tuple[int, ScanType]]) -> None:
        """`elements`: index and type of every enabled element. Raises `ValueError` where two have one index."""
        if len({index for index, _ in elements.values()}) != len(elements):
            raise ValueError("two scan elements have the same index")
        self.types = {name: type_ for name, (_, type_) in sorted(elements.items(), key=lambda item: item[1][0])}
        offset, offsets = 0, []
        for type_ in self.types.values():
            offset = _aligned(offset, type_.bytes)
            offsets.append(offset)
            offset += type_.bytes
        self.scan_bytes = _aligned(offset, max(type_.bytes for type_ in self.types.values()))
        self._dtype = np.dtype(
            {
                "names": list(self.types),
                "formats": [f"{'>' if t.is_big_endian else '<'}u{t.bytes}" for t in self.types.values()],
                "offsets": offsets,
                "itemsize": self.scan_bytes,
            }
        )

    def decode(self, scans: bytes) -> dict[str, NDArray[np.int64]]:
        """Return the numbers of each element of whole scans, shape (n,)."""
        table = np.frombuffer(scans, dtype=self._dtype)
        return {name: type_.decode(table[name]) for name, type_ in self.types.items()}


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size
