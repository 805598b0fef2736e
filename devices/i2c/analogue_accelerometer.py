"""An analogue accelerometer whose three outputs and supply are converted in turn by an ADS1115.

Inputs 0, 1 and 2 are x, y and z, input 3 is the supply of the sensor. Outputs are divided by the supply, of which they are a
share. The inputs are converted one after another; they are interpolated to common instants, evenly spaced by the host's clock.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from smbus2 import SMBus

from devices.block import DeviceInfo, SampleBlock
from devices.channel_cycles import ChannelCycles
from devices.clock import Clock
from devices.device import MAX_READ_NS
from devices.errors import ConfigurationReadBackError, DeviceError
from devices.i2c import ads1115
from devices.i2c.bus import BusOpener, I2cPart

Limits = tuple[float, float]
NOMINAL_SUPPLY_V = 3.0
"""Supply of the figures of the parts (Sawicki and Walendziuk 2016, Tables 1 to 3 and 6); limits are plausibility checks only."""
MAX_CYCLE_HZ = 125.0
"""Basis: four conversions and their transfers at 400 kHz take 6 ms."""
VOLTS_PER_COUNT = 1e-5
"""Of the output at the nominal supply, counted from half of it. Basis: a choice; a twelfth of a step of the converter, so that
rounding adds nothing."""
SUPPLY_INPUT = 3
"""Definition: the input of the supply."""
BAD_CYCLES = 10
"""After this many cycles in a row without a usable supply the sensor is reported as not connected. Basis: a choice; a dip of the
supply passes, and a loose wire is told within a second."""


@dataclass(frozen=True, slots=True)
class AnaloguePart:
    """An analogue accelerometer; its output at zero g is half of its supply."""

    name: str
    sensitivity_v_per_g: float
    full_scale_g: float
    sensitivity_limits_v_per_g: Limits
    zero_g_limits_v: tuple[Limits, Limits, Limits]
    """Limits of the zero-g output of x, y and z."""
    zero_g_offset_g_per_k: float
    supply_limits_v: Limits
    """Supply with which the part operates, by the data sheet."""
    scale_factor_per_k: float = 1e-4

    @property
    def zero_g_offset_g(self) -> float:
        """Largest zero-g offset of any axis."""
        largest_v = max(abs(limit - NOMINAL_SUPPLY_V / 2) for limits in self.zero_g_limits_v for limit in limits)
        return largest_v / self.sensitivity_v_per_g

    def possible_outputs_v(self) -> tuple[Limits, Limits, Limits]:
        """Return the smallest and largest output of x, y and z within full scale that the data sheet allows at 3 V."""
        swing_v = self.full_scale_g * self.sensitivity_limits_v_per_g[1]
        x, y, z = ((low - swing_v, high + swing_v) for low, high in self.zero_g_limits_v)
        return x, y, z


ADXL335 = AnaloguePart("ADXL335", 0.3, 3.0, (0.27, 0.33), ((1.35, 1.65), (1.35, 1.65), (1.2, 1.8)), 1e-3, (1.8, 3.6))
"""Data sheet."""
ADXL327 = AnaloguePart("ADXL327", 0.42, 2.0, (0.378, 0.462), ((1.3, 1.7),) * 3, 1e-3, (1.8, 3.6))
"""Data sheet."""
LIS344ALH = AnaloguePart("LIS344ALH", 0.6, 2.0, (0.57, 0.63), ((1.425, 1.575),) * 3, 0.4e-3, (2.4, 3.6))
"""Data sheet."""
ANALOGUE_PARTS = {part.name: part for part in (ADXL335, ADXL327, LIS344ALH)}
"""By name."""


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
        if not 0 < odr_hz <= MAX_CYCLE_HZ:
            raise ValueError(f"an ADS1115 cannot convert four inputs at {odr_hz:g} Hz; give at most {MAX_CYCLE_HZ:g}")
        self._sensor = sensor
        self._bus, self._address = bus, address
        self._odr_hz = odr_hz
        self._cycles = ChannelCycles(odr_hz, clock)
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
            supply_v = ads1115.convert(self._part, self._clock, SUPPLY_INPUT).volts
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
        deadline_ns = self._clock.now_ns() + MAX_READ_NS
        while len(self._cycles) <= self._block_samples + 1 and self._clock.now_ns() < deadline_ns:
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
        self._cycles.restart()
        self._bad_cycles = self._invalid = 0

    def _convert_cycle(self) -> None:
        """Convert all inputs once, at the next multiple of the period."""
        self._cycles.await_next()
        try:
            cycle = [ads1115.convert(self._part, self._clock, channel) for channel in range(ads1115.N_INPUTS)]
        except ConfigurationReadBackError:
            self._faults["configuration_lost"] += 1
            raise
        supply_v = cycle[SUPPLY_INPUT].volts
        if not self._is_usable(supply_v):
            self._faults["supply_voltage"] += 1
            self._invalid += 1
            self._bad_cycles += 1
            if self._bad_cycles == BAD_CYCLES:
                raise self._supply_error(supply_v)
            return
        self._bad_cycles = 0
        outputs_v = [conversion.volts for conversion in cycle]
        at_nominal_v = np.array(outputs_v[:SUPPLY_INPUT]) * NOMINAL_SUPPLY_V / supply_v
        if np.any(at_nominal_v < self._possible_v[0]) or np.any(at_nominal_v > self._possible_v[1]):
            self._faults["implausible_voltage"] += 1
        from_middle_g = (at_nominal_v - NOMINAL_SUPPLY_V / 2) / self._sensor.sensitivity_v_per_g
        is_saturated = bool(np.any(np.abs(from_middle_g) >= self._sensor.full_scale_g))
        self._cycles.add([conversion.middle_ns for conversion in cycle], outputs_v, is_saturated=is_saturated)

    def _take_block(self) -> SampleBlock | None:
        """Return the instants between the conversions so far, up to the first pause."""
        instants = self._cycles.take()
        if instants is None:
            return None
        share = instants.values[:, :SUPPLY_INPUT] / instants.values[:, SUPPLY_INPUT:]
        raw = np.rint((share - 0.5) * NOMINAL_SUPPLY_V / VOLTS_PER_COUNT).astype(np.int32)
        lost = max(instants.lost - self._invalid, 0)
        block = SampleBlock(instants.time_ns, raw, lost=lost, invalid=self._invalid, saturated=instants.saturated)
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
