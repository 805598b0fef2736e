"""An accelerometer of the Linux IIO subsystem, read through its buffer.

Sample times are the kernel's timestamps where they can be set to the monotonic clock, of which gateway time is a shift. A
device without them leaves the times to `devices.sample_clock`.
"""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import MAX_READ_S, MAX_SILENCE_NS
from devices.errors import DeviceError, TransferError
from devices.iio.buffer import ACCELERATION, ANGULAR_RATE, TIMESTAMP, IioBuffer
from devices.iio.sysfs import TEMPERATURE_PERIOD_NS, IioAttributes, find_iio_device
from devices.sample_clock import SampleClock
from devices.saturation import mark_saturated

MIN_LATENESS_NS, MAX_LATENESS_NS = -10_000_000_000, 100_000_000
"""A timestamp farther from the moment of its reading belongs to bytes that are out of step. Basis: a choice; a buffer holds 2 s,
and clocks of one host agree to less than 0.1 s."""
CLOCK_ATTRIBUTE, MONOTONIC = "current_timestamp_clock", "monotonic"


class IioAccelerometer:
    """A device with a buffer and scan elements."""

    def __init__(
        self,
        name: str,
        *,
        clock: Clock,
        odr_hz: float,
        range_g: float | None = None,
        trigger: str | None = None,
        block_samples: int = 8,
        serial: str | None = None,
        root: Path = Path("/"),
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`name`: name or label of the device; `root`: of the file system with `sys` and `dev`."""
        self._name, self._serial = name, serial
        self._odr_hz, self._range_g, self._trigger = odr_hz, range_g, trigger
        self._block_samples = block_samples
        self._clock, self._monotonic_ns = clock, monotonic_ns
        self._root = root
        self._sample_clock = SampleClock(odr_hz, usual_delay_s=1 / odr_hz)
        self._faults: Counter[str] = Counter()
        self._buffer: IioBuffer | None = None
        self._reset_state()

    def open(self) -> DeviceInfo:
        """Find the device, set and read back rate and range, and switch its buffer on. Raises `DeviceError`."""
        self.close()
        device = find_iio_device(self._root, self._name)
        rate_hz = device.set_number(device.rate_attribute, self._odr_hz, "device.odr_hz")
        buffer = IioBuffer(device, self._root / "dev" / device.number, self._trigger)
        has_monotonic_time = _set_monotonic_clock(device)
        try:
            buffer.open(rate_hz, self._block_samples)
            limits = buffer.layout.types[ACCELERATION[0]].limits
            if self._range_g is not None:
                buffer.close()
                device.set_range(self._range_g, limits[1])
                buffer.open(rate_hz, self._block_samples)
            units_per_g = device.units_per_g()
            gyro_rad_s = device.scale("anglvel", "x")[1] if buffer.has_gyro else None
        except DeviceError:
            buffer.close()
            raise
        self._device, self._buffer, self._limits = device, buffer, limits
        self._reset_state()
        self._has_times = has_monotonic_time and TIMESTAMP in buffer.layout.types
        self._offset_ns = self._clock.now_ns() - self._monotonic_ns()
        details = {"iio": device.number, "times": "kernel" if self._has_times else "counted"}
        return DeviceInfo(
            kind="iio",
            device_id=f"iio-{self._serial or self._name}",
            unit="counts",
            odr_hz=rate_hz,
            units_per_g=units_per_g,
            full_scale_g=limits[1] / units_per_g,
            gyro_rad_s_per_count=gyro_rad_s,
            details=details,
        )

    def read(self) -> SampleBlock | None:
        """Return the next block. Raises `TransferError` when the device has gone or is silent for two seconds."""
        if not self._blocks:
            self._receive()
        return self._blocks.popleft() if self._blocks else None

    def close(self) -> None:
        """Switch the buffer off."""
        if self._buffer is not None:
            self._buffer.close()
            self._buffer = None

    @property
    def faults(self) -> Mapping[str, int]:
        """`overrun` of the kernel's buffer and `misaligned` bytes, after which the buffer is switched off and on."""
        return {**self._faults, "clock_relearned": self._sample_clock.relearned}

    def _reset_state(self) -> None:
        self._sample_clock.restart()
        self._blocks: deque[SampleBlock] = deque()
        self._last_ns: int | None = None
        self._temperature_c: float | None = None
        self._temperature_due_ns = self._last_read_ns = self._clock.now_ns()

    def _receive(self) -> None:
        if self._buffer is None:
            raise TransferError(f"{self._name}: the device is not open; open it first")
        scans = self._buffer.read(MAX_READ_S)
        now_ns = self._clock.now_ns()
        if not scans:
            if now_ns - self._last_read_ns > MAX_SILENCE_NS:
                raise TransferError(
                    f"{self._device.folder}: no samples for {MAX_SILENCE_NS / 1e9:g} s; check bus and trigger"
                )
            return
        if now_ns >= self._temperature_due_ns:
            self._temperature_due_ns = now_ns + TEMPERATURE_PERIOD_NS
            self._temperature_c = self._device.temperature_c()
        table = self._buffer.layout.decode(scans)
        time_ns = self._sample_times(table, now_ns)
        self._last_read_ns = now_ns
        if time_ns is None:
            self._faults["misaligned"] += 1
            self._buffer.open(self._odr_hz, self._block_samples)
            return
        self._blocks.extend(self._make_blocks(table, time_ns))

    def _sample_times(self, table: Mapping[str, NDArray[np.int64]], now_ns: int) -> NDArray[np.int64] | None:
        """Return the gateway times of the samples; None where the bytes are out of step."""
        if not self._has_times:
            if (now_ns - self._last_read_ns) * self._odr_hz / 1e9 > self._device.read_number("buffer/length"):
                self._faults["overrun"] += 1  # the kernel drops samples without a word
                self._sample_clock.restart()
            return self._sample_clock.stamp(len(table[ACCELERATION[0]]), now_ns)
        time_ns = table[TIMESTAMP] + self._offset_ns
        before_ns = now_ns + MIN_LATENESS_NS if self._last_ns is None else self._last_ns
        ascending = bool(np.all(np.diff(time_ns, prepend=before_ns) > 0))
        plausible = int(time_ns[0]) > now_ns + MIN_LATENESS_NS and int(time_ns[-1]) < now_ns + MAX_LATENESS_NS
        return time_ns if ascending and plausible else None

    def _make_blocks(self, table: Mapping[str, NDArray[np.int64]], time_ns: NDArray[np.int64]) -> Iterator[SampleBlock]:
        """Return blocks; after lost samples a new block begins."""
        raw = np.column_stack([table[name] for name in ACCELERATION]).astype(np.int32)
        gyro = None
        if ANGULAR_RATE[0] in table:
            gyro = np.column_stack([table[name] for name in ANGULAR_RATE]).astype(np.int32)
        previous_ns = int(time_ns[0]) - round(1e9 / self._odr_hz) if self._last_ns is None else self._last_ns
        missing = np.rint(np.diff(time_ns, prepend=previous_ns) * (self._odr_hz / 1e9)).astype(int) - 1
        starts = sorted({0, *np.flatnonzero(missing > 0).tolist()})
        for begin, end in zip(starts, [*starts[1:], len(raw)], strict=True):
            lost = max(int(missing[begin]), 0)
            if lost and self._has_times:
                self._faults["overrun"] += 1
            yield SampleBlock(
                time_ns[begin:end],
                raw[begin:end],
                self._temperature_c,
                lost,
                gyro_counts=None if gyro is None else gyro[begin:end],
                saturated=mark_saturated(raw[begin:end], *self._limits),
            )
        self._last_ns = int(time_ns[-1])


def _set_monotonic_clock(device: IioAttributes) -> bool:
    """Return whether the timestamps are of the monotonic clock, which does not step."""
    if not device.has(CLOCK_ATTRIBUTE):
        return False
    try:
        device.write("buffer/enable", 0)  # the clock cannot be changed while the buffer is on
        device.write(CLOCK_ATTRIBUTE, MONOTONIC)
    except DeviceError:
        return False
    return device.read(CLOCK_ATTRIBUTE) == MONOTONIC
