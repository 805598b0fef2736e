"""An accelerometer of the Linux IIO subsystem without a usable buffer: its attributes in sysfs are read one after another.

The axes are read at different times; they are interpolated to common instants, evenly spaced by the host's clock.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from devices.channel_cycles import ChannelCycles
from devices.clock import Clock
from devices.device import MAX_READ_NS
from devices.errors import DeviceError
from devices.iio.sysfs import TEMPERATURE_PERIOD_NS, IioAttributes, find_iio_device
from devices.saturation import mark_saturated

MAX_POLLED_HZ = 200.0
"""Each attribute is a system call and a transfer of its own. Basis: a choice; 5 ms for four of them, at a bus of 100 kHz."""
FRESH_READINGS = 2.0
"""The part must sample at least so much faster than it is read. Basis: readings repeat."""


class PolledIioAccelerometer:
    """A device whose `in_accel_x_raw`, `in_accel_y_raw` and `in_accel_z_raw` are read in turn."""

    def __init__(
        self,
        name: str,
        *,
        clock: Clock,
        odr_hz: float,
        range_g: float | None = None,
        block_samples: int = 8,
        serial: str | None = None,
        root: Path = Path("/"),
    ) -> None:
        """`name`: name or label of the device; `root`: of the file system with `sys`. Raises `ValueError`."""
        if not 0 < odr_hz <= MAX_POLLED_HZ:
            raise ValueError(
                f"attributes cannot be read at {odr_hz:g} Hz; give at most {MAX_POLLED_HZ:g}, or mode = 'buffer'"
            )
        self._name, self._serial, self._root = name, serial, root
        self._odr_hz, self._range_g = odr_hz, range_g
        self._block_samples = block_samples
        self._clock = clock
        self._cycles = ChannelCycles(odr_hz, clock)
        self._faults: Counter[str] = Counter()
        self._reset_state()

    def open(self) -> DeviceInfo:
        """Find the device; set and read back rate and range. Raises `DeviceError`."""
        device = find_iio_device(self._root, self._name)
        self._limits = _limits(device)
        if self._range_g is not None:
            if self._limits is None:
                raise DeviceError(f"{device.folder}: does not state its number of bits; leave device.range_g out")
            device.set_range(self._range_g, self._limits[1])
        own_rate_hz = _set_own_rate(device, FRESH_READINGS * self._odr_hz)
        units_per_g = device.units_per_g()
        self._device = device
        self._reset_state()
        details = {"iio": device.number}
        if own_rate_hz is not None:
            details["rate of the part"] = f"{own_rate_hz:g} Hz"
        return DeviceInfo(
            kind="iio",
            device_id=f"iio-{self._serial or self._name}",
            unit="counts",
            odr_hz=self._odr_hz,
            units_per_g=units_per_g,
            full_scale_g=None if self._limits is None else self._limits[1] / units_per_g,
            details=details,
        )

    def read(self) -> SampleBlock | None:
        """Return the next block. Raises `TransferError`, `DeviceNotFoundError` when the device has gone."""
        deadline_ns = self._clock.now_ns() + MAX_READ_NS
        while len(self._cycles) <= self._block_samples + 1 and self._clock.now_ns() < deadline_ns:
            self._read_cycle()
        instants = self._cycles.take()
        if instants is None:
            return None
        raw = np.rint(instants.values).astype(np.int32)
        saturated = None if self._limits is None else instants.saturated
        return SampleBlock(instants.time_ns, raw, self._temperature_c, instants.lost, saturated=saturated)

    def close(self) -> None:
        """Nothing to release."""

    @property
    def faults(self) -> Mapping[str, int]:
        """`late`: cycles that the host was too late for."""
        return dict(self._faults)

    def _reset_state(self) -> None:
        self._cycles.restart()
        self._temperature_c: float | None = None
        self._temperature_due_ns = self._clock.now_ns()

    def _read_cycle(self) -> None:
        """Read all axes once, at the next multiple of the period."""
        now_ns = self._clock.now_ns()
        self._faults["late"] += self._cycles.await_next()
        times_ns, values = [], []
        for axis in "xyz":
            begin_ns = self._clock.now_ns()
            values.append(self._device.read_number(f"in_accel_{axis}_raw"))
            times_ns.append((begin_ns + self._clock.now_ns()) // 2)
        is_saturated = self._limits is not None and bool(mark_saturated(np.array([values]), *self._limits)[0])
        self._cycles.add(times_ns, values, is_saturated=is_saturated)
        if now_ns >= self._temperature_due_ns:
            self._temperature_due_ns = now_ns + TEMPERATURE_PERIOD_NS
            self._temperature_c = self._device.temperature_c()


def _limits(device: IioAttributes) -> tuple[int, int] | None:
    """Return the lowest and the highest reading; None where the device does not state its number of bits."""
    attribute = "scan_elements/in_accel_x_type"
    return device.read_type(attribute).limits if device.has(attribute) else None


def _set_own_rate(device: IioAttributes, least_hz: float) -> float | None:
    """Return the rate of the part, raised where it is slower than it has to be; None where it has none."""
    attribute = device.rate_attribute
    if not device.has(attribute):
        return None
    rate_hz = device.read_number(attribute)
    if rate_hz >= least_hz:
        return rate_hz
    fitting = [each for each in device.available(attribute) if each >= least_hz]
    if not fitting:
        raise DeviceError(
            f"{device.folder / attribute}: {rate_hz:g} Hz, too slow for device.odr_hz; it needs {least_hz:g}"
        )
    return device.set_number(attribute, min(fitting), "the rate that device.odr_hz needs")
