"""A LIS3DH as its data sheet describes it (DocID17530 Rev. 2, sections 5.1, 6.1.1, 8; application note AN3308, section 9).

The most significant bit of a register address makes it count up in a burst; with the FIFO on, it returns from OUT_Z_H to OUT_X_L.
"""

from typing import ClassVar

from tests.devices.i2c.i2c_chip import I2cChip, to_counts
from tests.devices.i2c.part import Part

COUNT_UP = 0x80
ODR_HZ = {1: 1, 2: 10, 3: 25, 4: 50, 5: 100, 6: 200, 7: 400, 9: 1344}
MG_PER_DIGIT = {0: 1, 1: 2, 2: 4, 3: 12}


class Lis3dhChip(I2cChip):
    power_on: ClassVar = {0x0F: 0x33, 0x20: 0x07, 0x2E: 0x00}
    addresses = (0x18, 0x19)
    fifo_places = 32
    fifo_register = 0x28 | COUNT_UP
    _newest = bytes(6)

    @property
    def odr_hz(self) -> float:
        return ODR_HZ[self.registers[0x20] >> 4] * (1 + self.rate_error)

    @property
    def deflected(self) -> bool:
        return self.registers.get(0x23, 0) >> 1 & 3 == 1

    @property
    def running(self) -> bool:
        return self.registers[0x20] >> 4 in ODR_HZ and self.registers[0x20] & 7 == 7

    def write_register(self, register: int, value: int) -> None:
        address = register & ~COUNT_UP
        if address == 0x2E and not value & 0xC0:  # bypass mode empties the FIFO
            self.fifo.clear()
        if address == 0x24:
            value &= 0x7F  # BOOT clears itself
        if 0x1E <= address <= 0x26 or address in {0x2E, 0x30}:
            self.registers[address] = value

    def next_register(self, register: int) -> int:
        return register + 1 if register & COUNT_UP else register

    def read_burst(self, length: int) -> bytes:
        if self._pointer != self.fifo_register:
            return super().read_burst(length)
        samples = [self.fifo.popleft() if self.fifo else self._newest for _ in range(-(-length // 6))]
        return b"".join(samples)[:length]

    def read_register(self, register: int) -> int:
        address = register & ~COUNT_UP
        if address == 0x2F:
            full, empty = len(self.fifo) == 32, not self.fifo
            watermark = len(self.fifo) > self.registers[0x2E] & 0x1F
            return watermark << 7 | full << 6 | empty << 5 | min(len(self.fifo), 31)
        return super().read_register(address)

    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        control = self.registers[0x23]
        bits = 12 if control & 0x08 else 10
        per_g = 1000 / MG_PER_DIGIT[control >> 4 & 3] / (1 if bits == 12 else 4)
        high_passed = self.registers.get(0x21, 0) & 0x08  # a high-passed output has no steady part
        words = [to_counts(0.0 if high_passed else axis_g, per_g, bits) << (16 - bits) for axis_g in force_g]
        self._newest = b"".join(word.to_bytes(2, "little", signed=True) for word in words)
        on = self.registers.get(0x24, 0) & 0x40 and self.registers[0x2E] & 0xC0 == 0x80
        return [self._newest] if on else []


PART = Part(
    kind="lis3dh",
    chip=Lis3dhChip,
    odr_hz=100.0,
    range_g=2,
    units_per_g=1000,
    configured=(0x23, 0x24, 0x20),
    level_registers=(0x2F,),
    other_odr_hz=200.0,
    other_range_g=4,
    code_limits=(-2048, 2047),
    registers={0x21: 0x00, 0x23: 0x88, 0x24: 0x40, 0x2E: 0x80, 0x20: 0x57},
    temperature="none",
)
