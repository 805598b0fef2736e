"""Three sensors of which one axis each is used, combined as one triaxial accelerometer (Zams and Łuczak 2024, section 2).

Each sensor samples by its own clock. The readings are interpolated to common instants, evenly spaced, so that the skew between
the axes is gone; instants within a gap of any sensor are lost.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.device import Device
from devices.errors import DeviceError

MAX_GAP_PERIODS = 1.6
"""A longer distance of two samples of a sensor is a gap. Basis: a rate error of 5 % and two samples."""
MAX_STREAM_S = 2.0
"""Samples of a sensor that wait for the others for longer are dropped. Basis: a choice; longer than a sensor is late, and a bound
of the memory."""


@dataclass(frozen=True, slots=True)
class SensitiveAxis:
    """A sensor, and its axis along the combined one."""

    device: Device
    index: int
    """0, 1 or 2: x, y or z of the sensor."""
    sign: int
    """-1: it points the other way."""


class _Stream:
    """The samples of one axis that wait for those of the others."""

    def __init__(self) -> None:
        self.time_ns: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.force_g: NDArray[np.float64] = np.zeros(0)
        self.saturated: NDArray[np.bool_] = np.zeros(0, dtype=np.bool_)

    def add(self, block: SampleBlock, axis: SensitiveAxis, units_per_g: float) -> None:
        marks = np.zeros(len(block), dtype=np.bool_) if block.saturated is None else block.saturated
        self.time_ns = np.concatenate([self.time_ns, block.time_ns])
        self.force_g = np.concatenate([self.force_g, axis.sign * block.raw[:, axis.index] / units_per_g])
        self.saturated = np.concatenate([self.saturated, marks])

    def drop_before(self, time_ns: int) -> None:
        """Drop the samples before the last one up to a time."""
        first = max(int(np.searchsorted(self.time_ns, time_ns, side="right")) - 1, 0)
        self.time_ns, self.force_g = self.time_ns[first:], self.force_g[first:]
        self.saturated = self.saturated[first:]


class CombinedAxes:
    """One triaxial accelerometer of three sensors."""

    def __init__(self, axes: Sequence[SensitiveAxis], *, odr_hz: float, serial: str | None = None) -> None:
        """`axes`: those of x, y and z; `serial`: a label of the three together."""
        self._axes = tuple(axes)
        self._odr_hz, self._serial = odr_hz, serial
        self._period_ns = round(1e9 / odr_hz)
        self._faults: Counter[str] = Counter()
        self._reset_state()

    def open(self) -> DeviceInfo:
        """Open all sensors. Raises `DeviceError`, which names the axis."""
        infos = []
        for name, axis in zip("xyz", self._axes, strict=True):
            try:
                infos.append(axis.device.open())
            except DeviceError as error:
                self.close()
                raise type(error)(f"axis {name}: {error}") from error
        self._infos = tuple(infos)
        self._reset_state()
        return DeviceInfo(
            kind="single_axis",
            device_id=f"single-axis-{self._serial or '+'.join(info.device_id for info in infos)}",
            unit="g",
            odr_hz=self._odr_hz,
            units_per_g=1.0,
            full_scale_g=_least(info.full_scale_g for info in infos),
            noise_g=_largest(info.noise_g for info in infos),
            zero_g_offset_g=_largest(info.zero_g_offset_g for info in infos),
            zero_g_offset_g_per_k=_largest(info.zero_g_offset_g_per_k for info in infos),
            scale_factor_per_k=_largest(info.scale_factor_per_k for info in infos),
            bandwidth_hz=_least(info.bandwidth_hz for info in infos),
            details={f"axis {name}": info.device_id for name, info in zip("xyz", infos, strict=True)},
        )

    def read(self) -> SampleBlock | None:
        """Return the next block; after a gap of any sensor a new block begins. Raises `DeviceError`, which names the axis."""
        for name, axis, stream, info in zip("xyz", self._axes, self._streams, self._infos, strict=True):
            try:
                block = axis.device.read()
            except DeviceError as error:
                raise type(error)(f"axis {name}: {error}") from error
            if block is not None and len(block):
                stream.add(block, axis, info.units_per_g)
                self._temperatures_c[name] = block.temperature_c
        return self._take_block()

    def close(self) -> None:
        """Close all sensors."""
        for axis in self._axes:
            axis.device.close()

    @property
    def faults(self) -> Mapping[str, int]:
        """The faults of all sensors, added up."""
        total = Counter(self._faults)
        for axis in self._axes:
            total.update(axis.device.faults)
        return dict(total)

    def _reset_state(self) -> None:
        self._streams = (_Stream(), _Stream(), _Stream())
        self._temperatures_c: dict[str, float | None] = {}
        self._last_ns: int | None = None

    def _take_block(self) -> SampleBlock | None:
        """Return the instants that all sensors have reached, up to the first gap of any of them."""
        if any(len(stream.time_ns) < 2 for stream in self._streams):
            return None
        first_ns = max(int(stream.time_ns[0]) for stream in self._streams)
        begin_ns = first_ns if self._last_ns is None else self._last_ns + self._period_ns
        if begin_ns < first_ns:
            begin_ns += -(-(first_ns - begin_ns) // self._period_ns) * self._period_ns
        end_ns = min(int(stream.time_ns[-1]) for stream in self._streams)
        instants_ns = np.arange(begin_ns, end_ns + 1, self._period_ns, dtype=np.int64)
        inside = np.ones(len(instants_ns), dtype=np.bool_)
        for stream in self._streams:
            inside &= _between_neighbours(stream.time_ns, instants_ns, MAX_GAP_PERIODS * self._period_ns)
        usable = np.flatnonzero(inside)
        if not len(usable):
            self._drop_old(end_ns)
            return None
        gaps = np.flatnonzero(np.diff(usable) > 1)
        chosen = instants_ns[usable[0] : usable[int(gaps[0]) if len(gaps) else -1] + 1]
        lost = 0 if self._last_ns is None else round((int(chosen[0]) - self._last_ns) / self._period_ns) - 1
        saturated = np.zeros(len(chosen), dtype=np.bool_)
        columns = []
        for stream in self._streams:
            right = np.clip(np.searchsorted(stream.time_ns, chosen), 1, len(stream.time_ns) - 1)
            saturated |= stream.saturated[right - 1] | stream.saturated[right]
            columns.append(np.interp(chosen - first_ns, stream.time_ns - first_ns, stream.force_g))
        self._last_ns = int(chosen[-1])
        for stream in self._streams:
            stream.drop_before(self._last_ns)
        known_c = [each for each in self._temperatures_c.values() if each is not None]
        temperature_c = sum(known_c) / len(known_c) if known_c else None
        return SampleBlock(chosen, np.column_stack(columns), temperature_c, lost, saturated=saturated)

    def _drop_old(self, end_ns: int) -> None:
        for stream in self._streams:
            stream.drop_before(max(end_ns, int(stream.time_ns[-1]) - round(MAX_STREAM_S * 1e9)))


def _between_neighbours(
    time_ns: NDArray[np.int64], instants_ns: NDArray[np.int64], longest_ns: float
) -> NDArray[np.bool_]:
    """Return the instants, shape (n,), whose neighbours in a stream are no gap apart."""
    right = np.clip(np.searchsorted(time_ns, instants_ns), 1, len(time_ns) - 1)
    return np.asarray(time_ns[right] - time_ns[right - 1] <= longest_ns, dtype=np.bool_)


def _largest(values: Iterable[float | None]) -> float | None:
    """Return the largest value; None where one is not known."""
    known = list(values)
    return max((value for value in known if value is not None), default=None) if None not in known else None


def _least(values: Iterable[float | None]) -> float | None:
    return min((value for value in values if value is not None), default=None)
