"""An ADXL345 as its data sheet describes it (Rev. G, "Register map", "Register definitions", "FIFO").

In stream mode a sample leaves the FIFO when the data registers are read; a burst beyond DATAZ1 does not advance it.
"""

from typing import ClassVar

from tests.devices.i2c.i2c_chip import I2cChip, to_counts
from tests.devices.i2c.part import Part

BYTES = 6


class Adxl345Chip(I2cChip):
    power_on: ClassVar = {0x00: 0xE5, 0x2C: 0x0A, 0x2D: 0x00, 0x30: 0x02, 0x31: 0x00, 0x38: 0x00}
    addresses = (0x53, 0x1D)
    fifo_places = 32
    fifo_register = 0x32
    _overrun = False

    @property
    def odr_hz(self) -> float:
        return 3200 * 2.0 ** ((self.registers[0x2C] & 0x0F) - 15) * (1 + self.rate_error)

    @property
    def deflected(self) -> bool:
        return bool(self.registers[0x31] & 0x80)

    @property
    def running(self) -> bool:
        return bool(self.registers[0x2D] & 0x08)

    def brown_out(self) -> None:
        super().brown_out()
        self._overrun = False

    def write_register(self, register: int, value: int) -> None:
        if register == 0x38 and not value & 0xC0:  # bypass mode empties the FIFO
            self.fifo.clear()
        read_only = register in {0x2B, 0x30}
        if (0x1E <= register <= 0x31 or register == 0x38) and not read_only:
            self.registers[register] = value

    def read_burst(self, length: int) -> bytes:
        if self._pointer != 0x32:
            return super().read_burst(length)
        self._overrun = False
        sample = self.fifo.popleft() if self.fifo else bytes(BYTES)
        return (sample + bytes([0, 0, len(self.fifo)]))[:length]

    def read_register(self, register: int) -> int:
        if register == 0x30:
            return (0x80 if self.fifo else 0) | self._overrun
        if register == 0x39:
            return len(self.fifo)
        return super().read_register(register)

    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        full_resolution, code = self.registers[0x31] & 0x08, self.registers[0x31] & 0x03
        bits, lsb_per_g = (10 + code, 256) if full_resolution else (10, 256 >> code)
        offset_g = [0.0156 * _signed(self.registers.get(0x1E + axis, 0)) for axis in range(3)]
        words = [to_counts(g + offset, lsb_per_g, bits) for g, offset in zip(force_g, offset_g, strict=True)]
        return [b"".join(word.to_bytes(2, "little", signed=True) for word in words)]

    def overrun(self) -> None:
        super().overrun()
        self._overrun = True


def _signed(value: int) -> int:
    return value - 256 if value & 0x80 else value


PART = Part(
    kind="adxl345",
    chip=Adxl345Chip,
    odr_hz=100.0,
    range_g=2,
    units_per_g=256,
    configured=(0x2C, 0x31, 0x2D),
    level_registers=(0x39,),
    other_odr_hz=200.0,
    other_range_g=4,
    code_limits=(-512, 511),
    registers={0x1E: 0, 0x1F: 0, 0x20: 0, 0x2C: 0x0A, 0x31: 0x08, 0x38: 0x80, 0x2D: 0x08},
    temperature="none",
)
