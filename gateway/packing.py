"""Exact conversion of sample blocks into messages and back.

Counts are stored as first differences. The differences of neighbouring samples are short numbers, which compress well and stay
readable as JSON.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from devices.block import SampleBlock
from gateway.messages import ClockQuality, Samples

Times = NDArray[np.int64]
MAX_PERIOD_NS = 1e12
"""A thousand seconds, longer than any sample period. Basis: a choice; a thousand seconds, longer than any sample period, and
exact in the packing."""


def pack(
    block: SampleBlock, *, time_ns: int, clock: ClockQuality, sequence: int, calibration_id: str | None
) -> Samples:
    """Return the message of a block; `time_ns` is the UTC of its newest sample.

    `int32` readings become differences in counts, `float64` readings stay in g. Raises `ValueError` for an empty block and
    for a reading that is not finite.
    """
    if not len(block):
        raise ValueError("a block without samples cannot be packed")
    counts = block.raw.dtype.kind == "i"
    x, y, z = _differences(block.raw) if counts else _plain(block.raw)
    gx, gy, gz = (None, None, None) if block.gyro_counts is None else _differences(block.gyro_counts)
    period_ns, offsets_ns = _pack_times(block.time_ns)
    return Samples(
        time_ns=time_ns,
        clock=clock,
        sequence=sequence,
        calibration_id=calibration_id,
        first_log_time_ns=int(block.time_ns[0]),
        period_ns=period_ns,
        offsets_ns=offsets_ns,
        unit="counts" if counts else "g",
        packing="difference" if counts else "plain",
        x=x,
        y=y,
        z=z,
        gx=gx,
        gy=gy,
        gz=gz,
        temperature_c=block.temperature_c,
        lost=block.lost,
        invalid=block.invalid,
        saturated=None if block.saturated is None else np.flatnonzero(block.saturated).tolist(),
    )


def unpack(samples: Samples) -> SampleBlock:
    """Return the block of a message. Raises `ValueError` where its columns and times do not match or do not fit into 64 bits."""
    count = len(samples.x)
    if not count or len(samples.y) != count or len(samples.z) != count:
        raise ValueError(f"columns of {count}, {len(samples.y)} and {len(samples.z)} samples")
    try:
        time_ns, raw = _unpack_times(samples, count), _readings(samples)
        gyro_counts = _gyro_counts(samples, count)
    except OverflowError as error:
        raise ValueError("a time or reading of more than 64 bits") from error
    return SampleBlock(
        time_ns=time_ns,
        raw=raw,
        temperature_c=samples.temperature_c,
        lost=samples.lost,
        invalid=samples.invalid,
        gyro_counts=gyro_counts,
        saturated=None if samples.saturated is None else _saturated(samples.saturated, count),
    )


def _differences(raw: NDArray[np.int32] | NDArray[np.float64]) -> list[list[int]]:
    rows = raw.astype(np.int64)  # the difference of two int32 may need 33 bits
    rows[1:] -= rows[:-1].copy()
    differences: list[list[int]] = rows.T.tolist()
    return differences


def _plain(raw: NDArray[np.int32] | NDArray[np.float64]) -> list[list[float]]:
    if not np.isfinite(raw).all():
        raise ValueError("a reading that is not finite cannot be packed; devices count it as invalid and leave it out")
    columns: list[list[float]] = raw.T.tolist()
    return columns


def _pack_times(time_ns: Times) -> tuple[float | None, list[int] | None]:
    """Return (period, None) if sample i is at first + rint(i * period) for one period, else (None, offsets).

    The mean period is tried first. Sample i bounds the period to offset_i / i -+ 0.5 ns / i. Every period in the intersection
    of these intervals is valid.
    """
    offsets_ns = time_ns[1:] - time_ns[0]
    count = len(offsets_ns)
    if not count:
        return None, []
    mean_period_ns = int(offsets_ns[-1]) / count
    if _is_period(mean_period_ns, offsets_ns):
        return mean_period_ns, None
    index, half_width_ns = _bounds(count)
    mean_ns = offsets_ns / index
    period_ns = float((mean_ns - half_width_ns).max() + (mean_ns + half_width_ns).min()) / 2
    return (period_ns, None) if _is_period(period_ns, offsets_ns) else (None, offsets_ns.tolist())


def _is_period(period_ns: float, offsets_ns: Times) -> bool:
    """Return whether every sample is at its multiple of the period, rounded."""
    index, _ = _bounds(len(offsets_ns))
    return abs(period_ns) <= MAX_PERIOD_NS and not np.count_nonzero(np.rint(index * period_ns) != offsets_ns)


@lru_cache(maxsize=64)
def _bounds(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the indices 1 to count, and the half width of each one's bound on the period."""
    index = np.arange(1.0, count + 1)
    return index, 0.5 / index


def _readings(samples: Samples) -> NDArray[np.int32] | NDArray[np.float64]:
    columns = [samples.x, samples.y, samples.z]
    if samples.unit == "g":
        readings_g = np.array(columns, dtype=np.float64).T
        return np.cumsum(readings_g, axis=0) if samples.packing == "difference" else readings_g
    counts = np.array(columns, dtype=np.int64).T
    return (np.cumsum(counts, axis=0) if samples.packing == "difference" else counts).astype(np.int32)


def _gyro_counts(samples: Samples, count: int) -> NDArray[np.int32] | None:
    columns = [column for column in (samples.gx, samples.gy, samples.gz) if column is not None]
    if not columns:
        return None
    if [len(column) for column in columns] != [count] * 3:
        raise ValueError(f"columns of {count} samples, and angular rates of {[len(column) for column in columns]}")
    return np.cumsum(np.array(columns, dtype=np.int64).T, axis=0).astype(np.int32)


def _saturated(places: list[int], count: int) -> NDArray[np.bool_]:
    marks = np.zeros(count, dtype=np.bool_)
    if places:
        if not 0 <= min(places) <= max(places) < count:
            raise ValueError(f"saturated samples {min(places)} to {max(places)} of {count}")
        marks[places] = True
    return marks


def _unpack_times(samples: Samples, count: int) -> Times:
    if samples.period_ns is not None:
        if not abs(samples.period_ns) <= MAX_PERIOD_NS:
            raise ValueError(f"samples {samples.period_ns} ns apart")
        offsets_ns = np.rint(np.arange(count) * samples.period_ns).astype(np.int64)
    else:
        offsets_ns = np.array([0, *(samples.offsets_ns or [])], dtype=np.int64)
    if len(offsets_ns) != count:
        raise ValueError(f"{count} samples and {len(offsets_ns)} times")
    time_ns: Times = samples.first_log_time_ns + offsets_ns
    return time_ns
