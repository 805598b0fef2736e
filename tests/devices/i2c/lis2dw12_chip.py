"""A LIS2DW12 as its data sheet describes it (DS11811 Rev. 8, sections 5 and 8)."""

from typing import ClassVar

from tests.devices.i2c.i2c_chip import I2cChip, to_counts
from tests.devices.i2c.part import Part

ODR_HZ = {1: 12.5, 2: 12.5, 3: 25, 4: 50, 5: 100, 6: 200, 7: 400, 8: 800, 9: 1600}


class Lis2dw12Chip(I2cChip):
    power_on: ClassVar = {0x0F: 0x44, 0x20: 0x00, 0x21: 0x04, 0x25: 0x00, 0x2E: 0x00}
    addresses = (0x18, 0x19)
    fifo_places = 32
    fifo_register = 0x28
    _newest = bytes(6)
    _overrun = False

    @property
    def odr_hz(self) -> float:
        return ODR_HZ[self.registers[0x20] >> 4] * (1 + self.rate_error)

    @property
    def deflected(self) -> bool:
        return self.registers.get(0x22, 0) >> 6 == 1

    @property
    def running(self) -> bool:
        return self.registers[0x20] >> 4 in ODR_HZ

    def brown_out(self) -> None:
        super().brown_out()
        self._overrun = False

    def write_register(self, register: int, value: int) -> None:
        if register == 0x21 and value & 0x40:  # SOFT_RESET clears itself
            self.brown_out()
        elif 0x20 <= register <= 0x25 or 0x2E <= register <= 0x3F:
            self.registers[register] = value
            if register == 0x2E and not value & 0xE0:  # bypass mode empties the FIFO
                self.fifo.clear()

    def next_register(self, register: int) -> int:
        return register + 1 if self.registers[0x21] & 0x04 else register

    def read_burst(self, length: int) -> bytes:
        if self._pointer != 0x28 or not self.registers[0x21] & 0x04:
            return super().read_burst(length)
        self._overrun = False
        samples = [self.fifo.popleft() if self.fifo else self._newest for _ in range(-(-length // 6))]
        return b"".join(samples)[:length]

    def read_register(self, register: int) -> int:
        if register == 0x2F:
            reached = len(self.fifo) >= max(self.registers[0x2E] & 0x1F, 1)
            return reached << 7 | self._overrun << 6 | len(self.fifo)
        if register in {0x0D, 0x0E}:
            raw = round((self.temperature_c - 25) * 16) << 4
            return raw.to_bytes(2, "little", signed=True)[register - 0x0D]
        return super().read_register(register)

    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        high_performance = self.registers[0x20] >> 2 & 3 == 1
        bits = 14 if high_performance else 12
        per_g = (1 << (bits - 2)) / (1 << (self.registers[0x25] >> 4 & 3))
        words = [to_counts(axis_g, per_g, bits) << (16 - bits) for axis_g in force_g]
        self._newest = b"".join(word.to_bytes(2, "little", signed=True) for word in words)
        return [self._newest] if self.registers[0x2E] >> 5 == 6 else []

    def overrun(self) -> None:
        super().overrun()
        self._overrun = True


PART = Part(
    kind="lis2dw12",
    chip=Lis2dw12Chip,
    odr_hz=100.0,
    range_g=2,
    units_per_g=4096,
    configured=(0x25, 0x2E, 0x20),
    level_registers=(0x2F,),
    other_odr_hz=200.0,
    other_range_g=4,
    code_limits=(-8192, 8191),
    registers={0x21: 0x0C, 0x22: 0x00, 0x25: 0x04, 0x2E: 0xC0, 0x20: 0x54},
)
