"""From raw blocks to specific force: calibration and low-pass, for several blocks at once because NumPy's cost is per call.

The thermal model uses the temperature of the sensor without the noise and the steps of its thermometer. Clipped samples, whose
true value may be larger, are found in the raw readings.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from devices.block import SampleBlock
from gateway.calibration.correction import Correction
from gateway.stages.lowpass import LowPass

TIME_CONSTANT_S = 30.0
"""Time constant of the filter, s. Basis: a housing warms up within many minutes, a thermometer steps by 0.1 °C from block to
block."""
MAX_BRIDGED_GAP_S = 0.05
"""A longer gap restarts the low-pass filter, which would otherwise invent data. Basis: a choice; some samples at 100 Hz, half a
period of the updates."""
CLIPPED_SHARE = 0.998
"""A reading beyond this share of full scale is clipped. Basis: a choice; below the rounding of a stated full scale, and no larger
share of the range is given up."""


class TemperatureFilter:
    """A low-pass filter of first order for temperatures at irregular times."""

    def __init__(self) -> None:
        self._filtered_c = math.nan
        self._time_ns = 0

    def update(self, time_ns: int, temperature_c: float | None) -> float:
        """Return the filtered temperature, °C, after a temperature or, for None, without a new one; NaN before the first."""
        if temperature_c is None:
            return self._filtered_c
        if math.isnan(self._filtered_c):
            self._filtered_c = temperature_c
        else:
            share = -math.expm1(-max(time_ns - self._time_ns, 0) / (TIME_CONSTANT_S * 1e9))
            self._filtered_c += share * (temperature_c - self._filtered_c)
        self._time_ns = time_ns
        return self._filtered_c


@dataclass(frozen=True, slots=True)
class ForceBatch:
    """The samples of consecutive blocks, in the housing frame."""

    blocks: list[SampleBlock]
    time_s: NDArray[np.float64]
    """Seconds since the first sample, shape (n,)."""
    force_g: NDArray[np.float64]
    """Specific force, shape (n, 3)."""
    lowpassed_g: NDArray[np.float64]
    """The same behind the low-pass filter."""
    raw: NDArray[np.int32] | NDArray[np.float64]

    def slices(self) -> Iterator[tuple[SampleBlock, slice]]:
        """Return each block with the place of its samples."""
        begin = 0
        for block in self.blocks:
            yield block, slice(begin, begin + len(block))
            begin += len(block)


class ForceStage:
    """Collects blocks, and corrects and filters them together."""

    def __init__(self, correction: Correction, lowpass: LowPass) -> None:
        self._correction = correction
        self._lowpass = lowpass
        self._thermometer = TemperatureFilter()
        self._runs: list[list[SampleBlock]] = [[]]
        """The waiting blocks; every run but the first follows a gap."""
        self._origin_ns = 0
        self.newest_ns: int | None = None
        """Gateway time of the newest sample; None before the first."""

    def push(self, block: SampleBlock) -> None:
        """Add a block."""
        first_ns = int(block.time_ns[0])
        if self.newest_ns is None:
            self._origin_ns = first_ns
        elif first_ns - self.newest_ns > MAX_BRIDGED_GAP_S * 1e9:
            self._runs.append([])
        self._runs[-1].append(block)
        self.newest_ns = int(block.time_ns[-1])

    def take(self) -> ForceBatch:
        """Return the samples of all blocks since the last call. Raises `ValueError` where there are none."""
        runs, self._runs = self._runs, [[]]
        blocks = [block for run in runs for block in run]
        time_ns = np.concatenate([block.time_ns for block in blocks])
        raw = np.concatenate([block.raw for block in blocks])
        force_g = self._correction.apply(raw, self._temperatures_c(blocks))
        return ForceBatch(
            blocks=blocks,
            raw=raw,
            time_s=(time_ns - self._origin_ns) * 1e-9,  # small numbers keep their nanoseconds
            force_g=force_g,
            lowpassed_g=self._filter(force_g, [sum(map(len, run)) for run in runs]),
        )

    def _temperatures_c(self, blocks: list[SampleBlock]) -> NDArray[np.float64] | None:
        """Return the filtered temperature of each sample for a thermal model, shape (n,), NaN before the first one."""
        if self._correction.thermal is None:
            return None
        filtered_c = [self._thermometer.update(int(block.time_ns[-1]), block.temperature_c) for block in blocks]
        return np.repeat(np.array(filtered_c), [len(block) for block in blocks])

    def _filter(self, force_g: NDArray[np.float64], lengths: list[int]) -> NDArray[np.float64]:
        """Return the low-passed force of runs of samples; the filter restarts at each run but the first."""
        if len(lengths) == 1:
            return self._lowpass.apply(force_g)
        filtered, begin = [], 0
        for number, length in enumerate(lengths):
            if number > 0:
                self._lowpass.restart()
            if length:
                filtered.append(self._lowpass.apply(force_g[begin : begin + length]))
            begin += length
        return np.concatenate(filtered)


def split_long_block(block: SampleBlock, period_s: float) -> list[SampleBlock]:
    """Return the block in parts that end with the last sample of each period of a fixed grid; a short one stays whole."""
    period_ns = round(period_s * 1e9)
    if block.time_ns[-1] - block.time_ns[0] <= period_ns:
        return [block]
    ends = np.flatnonzero(np.diff(block.time_ns // period_ns)) + 1
    bounds = pairwise([0, *ends.tolist(), len(block)])
    first, *others = (block.select(slice(a, b)) for a, b in bounds)
    return [first, *(replace(part, lost=0, invalid=0) for part in others)]


def find_clipped(
    readings: NDArray[np.int32] | NDArray[np.float64],
    saturated: NDArray[np.bool_] | None,
    full_scale: float | None,
) -> NDArray[np.bool_]:
    """Return which samples of readings (n, 3) are clipped, shape (n,).

    `saturated`: as the device marks them; None: it does not, and `full_scale`, in the readings' unit, decides where it is known.
    """
    if saturated is not None:
        return saturated
    clipped = np.zeros(len(readings), dtype=np.bool_)
    if full_scale is None or not len(readings):
        return clipped
    limit = CLIPPED_SHARE * full_scale
    if -limit < readings.min() and readings.max() < limit:
        return clipped
    return np.asarray((np.abs(readings) >= limit).any(axis=1), dtype=np.bool_)
