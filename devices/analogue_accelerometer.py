"""An analogue accelerometer whose three outputs and supply are converted in turn by an ADS1115.

Inputs 0, 1 and 2 are x, y and z, input 3 is the supply of the sensor. Outputs are divided by the supply, of which they are a
share. The inputs are converted one after another; they are interpolated to common instants, evenly spaced by the host's clock.
"""

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from smbus2 import SMBus

from devices import ads1115
from devices.analogue_parts import NOMINAL_SUPPLY_V, AnaloguePart
from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.errors import ConfigurationReadBackError, DeviceError
from devices.i2c import BusOpener, I2cPart

FASTEST_HZ = 125.0
"""Four conversions and their transfers at 400 kHz take 6 ms."""
VOLTS_PER_COUNT = 1e-5
"""Of the output at the nominal supply, counted from half of it."""
LONGEST_WAIT_NS = 500_000_000
SUPPLY = 3
BAD_CYCLES = 10
"""After this many cycles in a row without a usable supply the sensor is reported as not connected."""


def interpolate_channels(
    times_ns: NDArray[np.int64], volts: NDArray[np.float64], instants_ns: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the values of all channels at common instants, shape (n, channels), linearly between their own times.

    `times_ns` and `volts`: shape (cycles, channels). Every instant must lie within the times of every channel.
    """
    start_ns = int(times_ns[0].min())  # as ns since 1970 a float is too coarse
    instants = (instants_ns - start_ns).astype(np.float64)
    channels = range(times_ns.shape[1])
    return np.column_stack([np.interp(instants, times_ns[:, c] - start_ns, volts[:, c]) for c in channels])


def _near_saturated(
    times_ns: NDArray[np.int64], saturated: NDArray[np.bool_], instants_ns: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return the instants, shape (n,), that are interpolated from a saturated cycle; `times_ns`: shape (cycles, channels)."""
    found = np.zeros(len(instants_ns), dtype=np.bool_)
    for cycle in np.flatnonzero(saturated).tolist():
        begin_ns, end_ns = times_ns[max(cycle - 1, 0)].min(), times_ns[min(cycle + 1, len(times_ns) - 1)].max()
        found |= (instants_ns >= begin_ns) & (instants_ns <= end_ns)
    return found


class AnalogueAccelerometer:
    """An analogue accelerometer behind an ADS1115 on an I2C bus."""

    def __init__(
        self,
        sensor: AnaloguePart,
        bus: int,
        address: int,
        *,
        clock: Clock,
        odr_hz: float = 100.0,
        block_samples: int = 8,
        serial: str | None = None,
        open_bus: BusOpener = SMBus,
    ) -> None:
        """`serial`: a label, for the sensor has no number. Raises `ValueError`."""
        if not 0 < odr_hz <= FASTEST_HZ:
            raise ValueError(f"an ADS1115 cannot convert four inputs at {odr_hz:g} Hz; give at most {FASTEST_HZ:g}")
        self._sensor = sensor
        self._bus, self._address = bus, address
        self._odr_hz = odr_hz
        self._period_ns = round(1e9 / odr_hz)
        self._block_samples = block_samples
        self._serial = serial
        self._clock = clock
        self._part = I2cPart(bus, address, clock, open_bus)
        self._possible_v = np.array(sensor.possible_outputs_v()).T
        self._faults: Counter[str] = Counter()
        self._reset_state()

    def open(self) -> DeviceInfo:
        """Identify the converter and measure the supply of the sensor. Raises `DeviceError`."""
        self._part.open()
        try:
            ads1115.identify(self._part)
            supply_v = ads1115.convert(self._part, self._clock, SUPPLY).volts
            if not self._is_usable(supply_v):
                raise self._supply_error(supply_v)
        except DeviceError:
            self._part.close()
            raise
        self._reset_state()
        kind = self._sensor.name.lower()
        return DeviceInfo(
            kind="ads1115",
            device_id=f"{kind}-{self._serial or f'i2c{self._bus}-{self._address:02x}'}",
            unit="counts",
            odr_hz=self._odr_hz,
            units_per_g=self._sensor.sensitivity_v_per_g / VOLTS_PER_COUNT,
            full_scale_g=self._sensor.full_scale_g,
            zero_g_offset_g=self._sensor.zero_g_offset_g,
            zero_g_offset_g_per_k=self._sensor.zero_g_offset_g_per_k,
            scale_factor_per_k=self._sensor.scale_factor_per_k,
            details={
                "bus": f"/dev/i2c-{self._bus}",
                "address": f"{self._address:#04x}",
                "sensor": self._sensor.name,
                "supply": f"{supply_v:.2f} V",
            },
        )

    def read(self) -> SampleBlock | None:
        """Return the next block; after a pause a new block begins.

        Raises `ConfigurationReadBackError`, `TransferError`, and `DeviceError` when the supply of the sensor is missing.
        """
        deadline_ns = self._clock.now_ns() + LONGEST_WAIT_NS
        while len(self._times_ns) <= self._block_samples + 1 and self._clock.now_ns() < deadline_ns:
            self._convert_cycle()
        return self._take_block()

    def close(self) -> None:
        """Release the bus."""
        self._part.close()

    @property
    def faults(self) -> Mapping[str, int]:
        """Failed transfers by kind, `configuration_lost`, `supply_voltage` and `implausible_voltage` (outside the data sheet)."""
        return {**self._part.faults, **self._faults}

    def _reset_state(self) -> None:
        self._times_ns: list[list[int]] = []
        self._volts: list[list[float]] = []
        self._saturated: list[bool] = []
        """Cycles with an output beyond what the data sheet promises: the sensor or the converter may have reached its end."""
        self._next_ns: int | None = None
        self._cycle_ns = self._clock.now_ns()
        self._last_ns: int | None = None
        self._bad_cycles = self._invalid = 0

    def _convert_cycle(self) -> None:
        """Convert all inputs once, at the next multiple of the period."""
        now_ns = self._clock.now_ns()
        late = max(0, (now_ns - self._cycle_ns) // self._period_ns)
        self._cycle_ns += late * self._period_ns
        self._clock.sleep_s((self._cycle_ns - now_ns) / 1e9)
        self._cycle_ns += self._period_ns
        try:
            cycle = [ads1115.convert(self._part, self._clock, channel) for channel in range(ads1115.INPUTS)]
        except ConfigurationReadBackError:
            self._faults["configuration_lost"] += 1
            raise
        supply_v = cycle[SUPPLY].volts
        if not self._is_usable(supply_v):
            self._faults["supply_voltage"] += 1
            self._invalid += 1
            self._bad_cycles += 1
            if self._bad_cycles == BAD_CYCLES:
                raise self._supply_error(supply_v)
            return
        self._bad_cycles = 0
        outputs_v = [conversion.volts for conversion in cycle]
        at_nominal_v = np.array(outputs_v[:SUPPLY]) * NOMINAL_SUPPLY_V / supply_v
        if np.any(at_nominal_v < self._possible_v[0]) or np.any(at_nominal_v > self._possible_v[1]):
            self._faults["implausible_voltage"] += 1
        self._times_ns.append([conversion.middle_ns for conversion in cycle])
        self._volts.append(outputs_v)
        from_middle_g = (at_nominal_v - NOMINAL_SUPPLY_V / 2) / self._sensor.sensitivity_v_per_g
        self._saturated.append(bool(np.any(np.abs(from_middle_g) >= self._sensor.full_scale_g)))

    def _take_block(self) -> SampleBlock | None:
        """Return the instants between the conversions so far, up to the first pause."""
        times_ns, volts = np.array(self._times_ns, dtype=np.int64), np.array(self._volts)
        cycle_saturated = np.array(self._saturated)
        if len(times_ns) < 2:
            return None
        pauses = np.flatnonzero(np.diff(times_ns[:, 0]) > 1.5 * self._period_ns)
        end = int(pauses[0]) + 1 if len(pauses) else len(times_ns)
        kept = end if len(pauses) else end - 2  # between these two the next instant lies
        self._times_ns, self._volts = self._times_ns[kept:], self._volts[kept:]
        self._saturated = self._saturated[kept:]
        first_ns, last_ns = int(times_ns[0].max()), int(times_ns[end - 1].min())
        next_ns = first_ns if self._next_ns is None or self._next_ns < first_ns else self._next_ns
        instants_ns = np.arange(next_ns, last_ns + 1, self._period_ns, dtype=np.int64)
        if not len(instants_ns):
            return None
        at_instants = interpolate_channels(times_ns[:end], volts[:end], instants_ns)
        share = at_instants[:, :SUPPLY] / at_instants[:, SUPPLY:]
        raw = np.rint((share - 0.5) * NOMINAL_SUPPLY_V / VOLTS_PER_COUNT).astype(np.int32)
        lost = 0 if self._last_ns is None else round((next_ns - self._last_ns) / self._period_ns) - 1
        saturated = _near_saturated(times_ns[:end], cycle_saturated[:end], instants_ns)
        block = SampleBlock(
            instants_ns, raw, lost=max(lost - self._invalid, 0), invalid=self._invalid, saturated=saturated
        )
        self._last_ns = int(instants_ns[-1])
        self._next_ns = self._last_ns + self._period_ns
        self._invalid = 0
        return block

    def _is_usable(self, supply_v: float) -> bool:
        low_v, high_v = self._sensor.supply_limits_v
        return low_v <= supply_v <= high_v

    def _supply_error(self, supply_v: float) -> DeviceError:
        low_v, high_v = self._sensor.supply_limits_v
        return DeviceError(
            f"{self._part}: input 3 reads {supply_v:.2f} V, the supply of an {self._sensor.name} is {low_v:g} to {high_v:g} V;"
            " connect the sensor's supply to input 3"
        )
