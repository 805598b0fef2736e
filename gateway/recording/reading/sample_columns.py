"""The samples of many blocks in arrays, which take a tenth of the memory of the blocks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.recording import Recording, longest_increasing_mask, missing_before
from devices.saturation import GYRO_END_OF_RANGE, angular_rates


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

    @property
    def span_ns(self) -> tuple[int, int]:
        """Gateway times of the first and the last sample, without those that are out of order."""
        kept_ns = self.time_ns[longest_increasing_mask(self.time_ns)]
        return int(kept_ns[0]), int(kept_ns[-1])

    def recording(
        self,
        device: DeviceInfo,
        origin_ns: int | None = None,
        after_ns: int | None = None,
        restarts_ns: Sequence[int] = (),
    ) -> Recording | None:
        """Return the samples as one recording, times from `origin_ns` or from the first sample; None for fewer than two.

        Samples with a repeated or backward time are left out and counted. `after_ns` is the time of the sample before these.
        `restarts_ns` are those of the first sample of each later run of the gateway: what was not measured before is not lost.
        """
        mask = np.ones(len(self), dtype=np.bool_) if after_ns is None else self.time_ns > after_ns
        mask[mask] = longest_increasing_mask(self.time_ns[mask])
        if mask.sum() < 2:
            return None
        kept: slice | NDArray[np.bool_] = slice(None) if mask.all() else mask  # a slice copies nothing
        repeated = np.isin(self.time_ns[~mask], self.time_ns[mask])
        origin_ns = int(self.time_ns[0]) if origin_ns is None else origin_ns
        time_s = (self.time_ns[kept] - origin_ns) / 1e9
        before_s = [] if after_ns is None else [(after_ns - origin_ns) / 1e9]
        missing = missing_before(np.concatenate([before_s, time_s]))[len(before_s) :]
        restarts = np.searchsorted(self.time_ns[kept], np.array(restarts_ns, dtype=np.int64))
        missing[restarts[restarts < len(missing)]] = 0
        scale, rates = device.gyro_rad_s_per_count, self.gyro_counts
        return Recording(
            time_s=time_s,
            raw=self.raw[kept].astype(np.float64),
            unit=device.unit,
            lost_before=np.maximum(self._at_first_sample(self.lost)[kept], missing),
            unusable_before=self._at_first_sample(self.invalid)[kept],
            temperature_c=np.repeat(self.temperature_c, self.length)[kept],
            gyro_dps=None if scale is None or rates is None else np.degrees(angular_rates(rates[kept], scale)),
            saturated=None if self.saturated is None else self.saturated[kept],
            repeated=int(repeated.sum()),
            backward=int((~repeated).sum()),
            invalid=int(self.invalid.sum()),
            origin_ns=origin_ns,
        )

    def _at_first_sample(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return a count of each block at its first sample, zero at the others, shape (n,)."""
        spread = np.zeros(len(self), dtype=np.int64)
        spread[np.cumsum(self.length) - self.length] = counts
        return spread


def columns_of(blocks: Sequence[SampleBlock]) -> SampleColumns:
    """Return the samples of blocks, of which there is one at least."""
    known_c = [np.nan if block.temperature_c is None else block.temperature_c for block in blocks]
    return _join(
        blocks,
        length=np.array([len(block) for block in blocks], dtype=np.int64),
        lost=np.array([block.lost for block in blocks], dtype=np.int64),
        invalid=np.array([block.invalid for block in blocks], dtype=np.int64),
        temperature_c=np.array(known_c, dtype=np.float64),
    )


def concatenate(parts: Sequence[SampleColumns]) -> SampleColumns:
    """Return the samples of all parts, of which there is one at least, in their order."""
    if len(parts) == 1:
        return parts[0]
    return _join(
        parts,
        length=np.concatenate([part.length for part in parts]),
        lost=np.concatenate([part.lost for part in parts]),
        invalid=np.concatenate([part.invalid for part in parts]),
        temperature_c=np.concatenate([part.temperature_c for part in parts]),
    )


def _join(parts: Sequence[SampleBlock] | Sequence[SampleColumns], **of_blocks: NDArray[Any]) -> SampleColumns:
    """Return the samples of all parts beside the columns with a value for each block."""
    return SampleColumns(
        time_ns=np.concatenate([part.time_ns for part in parts]),
        raw=np.concatenate([part.raw for part in parts]),
        gyro_counts=_join_rates([part.gyro_counts for part in parts], [len(part) for part in parts]),
        saturated=_join_marks([part.saturated for part in parts]),
        **of_blocks,
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
