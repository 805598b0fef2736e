"""The samples of many blocks in arrays, which take a tenth of the memory of the blocks."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from devices.block import SampleBlock
from devices.saturation import GYRO_END_OF_RANGE

BLOCKS_PER_PART = 1024
"""So many blocks are kept until they become arrays; basis: a fraction of a megabyte."""


@dataclass(frozen=True, slots=True)
class SampleColumns:
    """The samples of m blocks, n in all, in the sensor's axes and unit."""

    time_ns: NDArray[np.int64]
    """Gateway time of each sample, shape (n,)."""
    raw: NDArray[np.int32] | NDArray[np.float64]
    """Readings, shape (n, 3)."""
    gyro_counts: NDArray[np.int32] | None
    """Angular rates, shape (n, 3), at the end of their range where a block has none; None: no block has them."""
    saturated: NDArray[np.bool_] | None
    """Saturated samples, shape (n,); None: a block does not mark them."""
    length: NDArray[np.int64]
    """Samples of each block, shape (m,); the following columns have this shape too."""
    lost: NDArray[np.int64]
    invalid: NDArray[np.int64]
    temperature_c: NDArray[np.float64]
    """NaN where a block has none."""

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def end_ns(self) -> NDArray[np.int64]:
        """Gateway time of the newest sample of each block, shape (m,)."""
        return self.time_ns[np.cumsum(self.length) - 1]

    def at_first_sample(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return a count of each block at its first sample, zero at the others, shape (n,)."""
        spread = np.zeros(len(self), dtype=np.int64)
        spread[np.cumsum(self.length) - self.length] = counts
        return spread


@dataclass(slots=True)
class ColumnBuilder:
    """Gathers blocks into columns."""

    _blocks: list[SampleBlock] = field(default_factory=list)
    _parts: list[SampleColumns] = field(default_factory=list)

    def add(self, block: SampleBlock) -> None:
        """Add the next block."""
        self._blocks.append(block)
        if len(self._blocks) == BLOCKS_PER_PART:
            self._gather()

    def columns(self) -> SampleColumns | None:
        """Return the columns of all blocks; None where there was none."""
        if self._blocks:
            self._gather()
        return concatenate(self._parts) if self._parts else None

    def _gather(self) -> None:
        blocks, self._blocks = self._blocks, []
        lengths = [len(block) for block in blocks]
        known_c = [np.nan if block.temperature_c is None else block.temperature_c for block in blocks]
        part = SampleColumns(
            time_ns=np.concatenate([block.time_ns for block in blocks]),
            raw=np.concatenate([block.raw for block in blocks]),
            gyro_counts=_join_rates([block.gyro_counts for block in blocks], lengths),
            saturated=_join_marks([block.saturated for block in blocks]),
            length=np.array(lengths, dtype=np.int64),
            lost=np.array([block.lost for block in blocks], dtype=np.int64),
            invalid=np.array([block.invalid for block in blocks], dtype=np.int64),
            temperature_c=np.array(known_c, dtype=np.float64),
        )
        self._parts.append(part)


def concatenate(parts: Sequence[SampleColumns]) -> SampleColumns:
    """Return the samples of all parts, of which there is one at least, in their order."""
    if len(parts) == 1:
        return parts[0]
    return SampleColumns(
        time_ns=np.concatenate([part.time_ns for part in parts]),
        raw=np.concatenate([part.raw for part in parts]),
        gyro_counts=_join_rates([part.gyro_counts for part in parts], [len(part) for part in parts]),
        saturated=_join_marks([part.saturated for part in parts]),
        length=np.concatenate([part.length for part in parts]),
        lost=np.concatenate([part.lost for part in parts]),
        invalid=np.concatenate([part.invalid for part in parts]),
        temperature_c=np.concatenate([part.temperature_c for part in parts]),
    )


def _join_rates(rates: Sequence[NDArray[np.int32] | None], lengths: Sequence[int]) -> NDArray[np.int32] | None:
    if all(each is None for each in rates):
        return None
    filled = [
        np.full((length, 3), GYRO_END_OF_RANGE, dtype=np.int32) if each is None else each
        for each, length in zip(rates, lengths, strict=True)
    ]
    return np.concatenate(filled)


def _join_marks(marks: Sequence[NDArray[np.bool_] | None]) -> NDArray[np.bool_] | None:
    known = [each for each in marks if each is not None]
    return np.concatenate(known) if len(known) == len(marks) else None
