"""An ADS1115 as its data sheet describes it (SBAS444D, sections 9.3 and 9.6) with an analogue accelerometer at its inputs.

The outputs of the sensor are a share of its supply: half of it at zero g, and the sensitivity in proportion.
"""

import errno
from typing import ClassVar

from tests.devices.i2c.i2c_chip import I2cChip

FULL_SCALE_V = {0: 6.144, 1: 4.096, 2: 2.048, 3: 1.024, 4: 0.512, 5: 0.256}
RATES_HZ = (8, 16, 32, 64, 128, 250, 475, 860)
RESET = {0x00: 0x0000, 0x01: 0x8583, 0x02: 0x8000, 0x03: 0x7FFF}


class Ads1115Chip(I2cChip):
    power_on: ClassVar = RESET
    addresses = (0x48, 0x49, 0x4A, 0x4B)
    fifo_places = 0
    fifo_register = -1
    sensitivity_v_per_g = 0.3
    """At a supply of 3 V."""
    supply_v = 3.0
    odr_hz = 0.0
    running = False
    _done_s = 0.0
    _result = 0
    stuck = False
    brown_out_at_s = float("inf")
    """In the first conversion after this time the supply dips."""

    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        raise NotImplementedError(force_g)

    def brown_out(self) -> None:
        super().brown_out()
        self._done_s = 0.0

    def read_burst(self, length: int) -> bytes:
        value = self.registers[self._pointer & 3]
        if self._pointer & 3 == 1:
            value = value & 0x7FFF | (0x8000 if self._ready else 0)
        elif self._pointer & 3 == 0:
            value = self._result & 0xFFFF if self._ready else value
        bits = self.disturbed.get(self._pointer)
        return (value ^ (bits.pop(0) if bits else 0)).to_bytes(2, "big")[:length]

    @property
    def _ready(self) -> bool:
        return not self.stuck and self.clock.elapsed_s >= self._done_s

    def _write(self, data: bytes) -> None:
        self._pointer = data[0]
        if len(data) == 3:
            value = int.from_bytes(data[1:], "big")
            self.log.append(("write", data[0], value))
            self.registers[data[0] & 3] = value
            if data[0] == 1 and value & 0x8000 and self._ready:
                self._convert(value)
        elif len(data) == 2:
            raise OSError(errno.EREMOTEIO, "half a register")

    def _convert(self, config: int) -> None:
        """The result is the mean over a conversion, for a smooth signal the value in its middle."""
        duration_s = 1 / (RATES_HZ[config >> 5 & 7] * (1 + self.rate_error))
        middle_s = self.clock.elapsed_s + 25e-6 + duration_s / 2
        volts = self._input_v(config >> 12 & 7, middle_s)
        units = round(volts / FULL_SCALE_V[config >> 9 & 7] * 32768)
        self._result = min(max(units, -32768), 32767)
        self._done_s = self.clock.elapsed_s + 25e-6 + duration_s
        if self.clock.elapsed_s > self.brown_out_at_s:
            self.brown_out()
            self.brown_out_at_s = float("inf")

    def _input_v(self, mux: int, time_s: float) -> float:
        assert mux >= 4, "the sensor is wired against ground"
        if mux == 7:
            return self.supply_v
        volts = self.supply_v / 2 + self.signal(time_s)[mux - 4] * self.sensitivity_v_per_g * self.supply_v / 3.0
        return min(max(volts, 0.0), self.supply_v)
