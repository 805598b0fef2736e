"""A recording in memory, and its construction from the rows of a file.

Rows that cannot be used are left out and counted by kind, and the gap that they leave is known.
"""

from bisect import bisect_left
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import RawUnit

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """The usable samples of one recording, oldest first, and the number of samples lost between them."""

    time_s: Floats
    """Shape (n,), n >= 2, strictly increasing by at least 1 ns, from any origin; see `origin_ns`."""
    raw: Floats
    """Shape (n, 3), finite, in `unit`; whole numbers in counts."""
    unit: RawUnit
    lost_before: Integers
    """Samples missing immediately before each sample, shape (n,)."""
    unusable_before: Integers
    """Rows left out immediately before each sample, shape (n,); those after the last sample are counted with it."""
    temperature_c: Floats | None = None
    """Shape (n,), NaN where a row has none."""
    gyro_dps: Floats | None = None
    """Angular rate in degrees per second, shape (n, 3), NaN where a row has none."""
    saturated: NDArray[np.bool_] | None = None
    """Samples at the end of what the sensor can read, shape (n,); None: it does not mark them."""
    repeated: int = 0
    """Rows left out because their time occurred before."""
    backward: int = 0
    """Rows left out because their time is out of order."""
    invalid: int = 0
    """Rows left out because they have no numbers, NaN, or too few or too many columns."""
    blank: int = 0
    """Blank lines, which represent no sample."""
    truncated: int = 0
    """1 if the last line was incomplete and is left out."""
    origin_ns: int | None = None
    """UTC of `time_s` = 0 if it is known (an absolute recording)."""

    def __post_init__(self) -> None:
        n = len(self.time_s)
        if n < 2 or {len(self.raw), len(self.lost_before), len(self.unusable_before)} != {n}:
            raise ValueError("a recording needs at least two samples, each with a time and its readings")
        if np.any(np.diff(self.offset_ns()) <= 0):
            raise ValueError("the times of a recording must increase; recording_from_rows leaves out those that do not")

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def lost(self) -> int:
        """Number of missing samples."""
        return int(self.lost_before.sum())

    @property
    def rate_hz(self) -> float:
        """Measured rate, without the gaps."""
        return 1.0 / typical_interval(self.time_s)

    def part(self, start: int, stop: int) -> "Recording":
        """Return the samples from index `start` until before `stop`, on the same time axis.

        Losses before the first one are left out. The counts of rows that were left out, except `unusable_before`, remain those of
        the whole recording, because their times are not known.
        """
        if start == 0 and stop == len(self):
            return self
        kept = slice(start, stop)
        lost_before, unusable_before = self.lost_before[kept].copy(), self.unusable_before[kept].copy()
        if start > 0:
            lost_before[0] = unusable_before[0] = 0
        return self._select(kept, lost_before, unusable_before)

    def continued_by(self, other: "Recording", start: int) -> "Recording":
        """Return the samples from index `start` on, and after them those of another recording on the same time axis.

        The counts of rows that were left out, except `unusable_before`, are those of the other one.
        """
        return replace(
            other,
            time_s=np.concatenate([self.time_s[start:], other.time_s]),
            raw=np.concatenate([self.raw[start:], other.raw]),
            lost_before=np.concatenate([self.lost_before[start:], other.lost_before]),
            unusable_before=np.concatenate([self.unusable_before[start:], other.unusable_before]),
            temperature_c=_joined(self, other, "temperature_c", np.nan, start),
            gyro_dps=_joined(self, other, "gyro_dps", np.nan, start),
            saturated=_joined(self, other, "saturated", False, start),
        )

    def without_invalid(self, invalid: NDArray[np.bool_]) -> "Recording":
        """Return the other rows; each counts the invalid ones before it as unusable."""
        kept = ~invalid
        lost_before = np.diff(np.cumsum(self.lost_before)[kept], prepend=0)
        unusable_before = np.diff(np.cumsum(self.unusable_before + invalid)[kept], prepend=0)
        found = self._select(kept, lost_before, unusable_before)
        return replace(found, invalid=self.invalid + int(invalid.sum()))

    def without_repeats(self, fresh: NDArray[np.bool_]) -> "Recording":
        """Return the rows with a new reading, of `fresh` (n,), the first of which is one; each keeps the time of its first row.

        Rows lost in a gap are counted as readings, of the median number of rows each.
        """
        first = np.flatnonzero(fresh)
        rows_per_reading = float(np.median(np.diff(first)))
        lost = np.rint(np.add.reduceat(self.lost_before, first) / rows_per_reading).astype(np.int64)
        return self._select(fresh, lost, np.add.reduceat(self.unusable_before, first))

    def _select(self, kept: slice | NDArray[np.bool_], lost_before: Integers, unusable_before: Integers) -> "Recording":
        return replace(
            self,
            time_s=self.time_s[kept],
            raw=self.raw[kept],
            lost_before=lost_before,
            unusable_before=unusable_before,
            temperature_c=None if self.temperature_c is None else self.temperature_c[kept],
            gyro_dps=None if self.gyro_dps is None else self.gyro_dps[kept],
            saturated=None if self.saturated is None else self.saturated[kept],
        )

    def offset_ns(self) -> Integers:
        """Return the time of each sample after the first, shape (n,)."""
        return elapsed_ns(self.time_s)


def _joined(first: Recording, other: Recording, name: str, unknown: float, start: int) -> NDArray[Any] | None:
    """Return an optional column of two recordings, the first from `start` on; None where neither has it."""
    before, after = getattr(first, name), getattr(other, name)
    if before is None and after is None:
        return None
    if before is None:
        before = np.full((len(first), *after.shape[1:]), unknown)
    elif after is None:
        after = np.full((len(other), *before.shape[1:]), unknown)
    return np.concatenate([before[start:], after])


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleRows:
    """The rows with numbers in their order in the file, including NaN and times out of order."""

    place: Integers
    """Index of each row among all `count` rows, shape (m,); the other rows have no numbers."""
    count: int
    time_s: Floats
    raw: Floats
    temperature_c: Floats | None = None
    gyro_dps: Floats | None = None


def elapsed_ns(time_s: Floats) -> Integers:
    """Return the nanoseconds since the first entry."""
    elapsed: Integers = np.rint((time_s - time_s[0]) * 1e9).astype(np.int64)
    return elapsed


def typical_interval(time: Floats) -> float:
    """Return the mean of the intervals within half of their median, which excludes gaps and averages coarse time stamps."""
    interval = np.diff(time)
    median = np.sort(interval)[(len(interval) - 1) // 2]
    return float(interval[np.abs(interval - median) <= 0.5 * median].mean())


def longest_increasing_mask(time_ns: Integers) -> NDArray[np.bool_]:
    """Return the mask of the longest strictly increasing subsequence, which leaves out the fewest entries.

    Patience sorting; of equal times the first one is kept.
    """
    if np.all(np.diff(time_ns) > 0):
        return np.ones(len(time_ns), dtype=np.bool_)
    ends: list[int] = []  # smallest last time of a subsequence of each length
    places: list[int] = []
    predecessor = np.full(len(time_ns), -1)
    for place, time in enumerate(time_ns.tolist()):
        length = bisect_left(ends, time)
        predecessor[place] = places[length - 1] if length else -1
        if length == len(ends):
            ends.append(time)
            places.append(place)
        elif time < ends[length]:
            ends[length], places[length] = time, place
    mask = np.zeros(len(time_ns), dtype=np.bool_)
    place = places[-1]
    while place >= 0:
        mask[place] = True
        place = int(predecessor[place])
    return mask


def recording_from_rows(rows: SampleRows, unit: RawUnit, blank: int = 0, truncated: int = 0) -> Recording:
    """Return the usable rows as a recording; count the others by kind, and determine the gaps.

    Raises `ValueError` when fewer than two samples are usable, when less than half of the times can be kept in order, or when
    more than a quarter are out of order.
    """
    usable = np.isfinite(rows.time_s) & np.isfinite(rows.raw).all(axis=1)
    numbers = np.flatnonzero(usable)
    if len(numbers) < 2:
        raise ValueError(f"no two usable samples in {rows.count} rows; check its columns, unit and delimiter")
    time_ns = elapsed_ns(rows.time_s[numbers])
    mask = longest_increasing_mask(time_ns)
    repeated = ~mask & (time_ns == _index_after_filter(time_ns, mask))
    backward = ~mask & ~repeated
    if mask.sum() < max(2, len(numbers) / 2) or backward.sum() > len(numbers) / 4:
        text = f"time repeats in {repeated.sum()} and goes back in {backward.sum()} of {len(numbers)} rows"
        raise ValueError(f"{text}; check its time column, and that it is one recording")
    kept = numbers[mask]
    unusable_before = np.diff(rows.place[kept], prepend=-1) - 1
    unusable_before[-1] += rows.count - 1 - rows.place[kept[-1]]
    return Recording(
        time_s=rows.time_s[kept],
        raw=rows.raw[kept],
        unit=unit,
        lost_before=_lost_before(rows, kept, out_of_order=numbers[backward], repeated=numbers[repeated]),
        unusable_before=unusable_before,
        temperature_c=None if rows.temperature_c is None else rows.temperature_c[kept],
        gyro_dps=None if rows.gyro_dps is None else rows.gyro_dps[kept],
        repeated=int(repeated.sum()),
        backward=int(backward.sum()),
        invalid=rows.count - len(numbers),
        blank=blank,
        truncated=truncated,
    )


def _lost_before(rows: SampleRows, kept: Integers, out_of_order: Integers, repeated: Integers) -> Integers:
    """Return the number of samples missing in the gap before each sample, shape of `kept`.

    A row without numbers stands for one sample of its gap. A row out of order stands for one sample of the gap at its time, or
    else of the gap in which it stands. A repeated row stands for none.
    """
    time_s, place = rows.time_s[kept], rows.place[kept]
    missing = missing_before(time_s)
    known = np.concatenate([place, rows.place[out_of_order], rows.place[repeated]])
    came_in = np.searchsorted(place, np.setdiff1d(np.arange(rows.count), known))
    by_time = np.searchsorted(time_s, rows.time_s[out_of_order])
    by_place = np.searchsorted(place, rows.place[out_of_order])
    falls_in = np.where(np.append(missing, 0)[by_time] > 0, by_time, by_place)
    stand_in = np.bincount(np.concatenate([came_in, falls_in]), minlength=len(kept) + 1)[: len(kept)]
    lost: Integers = np.maximum(missing - stand_in, 0)
    return lost


def missing_before(time_s: Floats) -> Integers:
    """Return the number of typical intervals beyond one before each sample, shape (n,)."""
    intervals = np.rint(np.diff(time_s) / typical_interval(time_s)).astype(np.int64)
    return np.concatenate([[0], np.maximum(intervals - 1, 0)])


def _index_after_filter(time_ns: Integers, mask: NDArray[np.bool_]) -> Integers:
    """Return for each entry the last entry of the mask up to it; for an entry before all of them the first one of the mask."""
    latest: Integers = time_ns[mask][np.maximum(np.cumsum(mask) - 1, 0)]
    return latest
