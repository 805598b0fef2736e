"""An MPU-9250 and an MPU-6050 as their register maps describe them (RM-MPU-9250A-00 Rev. 1.6, RM-MPU-6000A-00 Rev. 4.2).

The FIFO is a ring of bytes: a full one overwrites its oldest bytes, and then no longer begins with a sample.
"""

from dataclasses import replace
from typing import ClassVar

from tests.devices.i2c.i2c_chip import I2cChip, to_counts
from tests.devices.i2c.part import Part

SAMPLE_BYTES = 14


class Mpu9250Chip(I2cChip):
    power_on: ClassVar = {0x75: 0x71, 0x6B: 0x01, 0x6A: 0x00, 0x19: 0x00, 0x1A: 0x00, 0x1C: 0x00, 0x23: 0x00}
    addresses = (0x68, 0x69)
    fifo_places = 512
    places_per_sample = SAMPLE_BYTES
    fifo_register = 0x74
    temperature_zero_c, temperature_lsb_per_k = 21.0, 333.87
    _overflow = False

    @property
    def odr_hz(self) -> float:
        base_hz = 1000 if 1 <= self.registers[0x1A] & 7 <= 6 else 8000
        return base_hz / (1 + self.registers[0x19]) * (1 + self.rate_error)

    @property
    def deflected(self) -> bool:
        return self.registers[0x1C] & 0xE0 == 0xE0

    @property
    def running(self) -> bool:
        awake = not self.registers[0x6B] & 0x40
        return bool(awake and self.registers[0x6A] & 0x40 and self.registers[0x23])

    def brown_out(self) -> None:
        super().brown_out()
        self._overflow = False

    def write_register(self, register: int, value: int) -> None:
        if register == 0x6B and value & 0x80:
            self.brown_out()
            return
        if register == 0x6A and value & 0x04:
            self.fifo.clear()
            value &= ~0x04
        if register not in {0x3A, 0x75, 0x72, 0x73}:
            self.registers[register] = value

    def read_burst(self, length: int) -> bytes:
        if self._pointer != 0x74:
            return super().read_burst(length)
        return b"".join(self.fifo.popleft() if self.fifo else b"\xff" for _ in range(length))

    def read_register(self, register: int) -> int:
        if register == 0x3A:
            status, self._overflow = 0x10 if self._overflow and self.registers.get(0x38, 0) & 0x10 else 0, False
            return status
        if register in {0x72, 0x73}:
            return len(self.fifo).to_bytes(2, "big")[register - 0x72]
        if register in {0x41, 0x42}:
            return self._temperature().to_bytes(2, "big", signed=True)[register - 0x41]
        return super().read_register(register)

    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        enabled = self.registers[0x23]
        per_g = 16384 >> (self.registers[0x1C] >> 3 & 3)
        per_deg_s = 131.072 / (1 << (self.registers.get(0x1B, 0) >> 3 & 3))
        words = []
        if enabled & 0x08:
            words += [to_counts(axis_g, per_g, 16) for axis_g in force_g]
        if enabled & 0x80:
            words.append(self._temperature())
        words += [
            to_counts(rate_deg_s, per_deg_s, 16)
            for rate_deg_s, bit in zip(self.rates_deg_s, (0x40, 0x20, 0x10), strict=True)
            if enabled & bit
        ]
        return [bytes([byte]) for word in words for byte in word.to_bytes(2, "big", signed=True)]

    def overrun(self) -> None:
        self.drop_places(len(self.fifo) + SAMPLE_BYTES - self.fifo_places)
        self.overwritten += 1
        self._overflow = True

    def _temperature(self) -> int:
        return round((self.temperature_c - self.temperature_zero_c) * self.temperature_lsb_per_k)


class Mpu6050Chip(Mpu9250Chip):
    power_on: ClassVar = {**Mpu9250Chip.power_on, 0x75: 0x68, 0x6B: 0x40}
    fifo_places = 1024
    temperature_zero_c, temperature_lsb_per_k = 36.53, 340.0


REGISTERS = {0x19: 9, 0x1A: 3, 0x1B: 0x00, 0x1C: 0x00, 0x23: 0xF8, 0x38: 0x10, 0x6A: 0x40, 0x6B: 0x01, 0x6C: 0x00}
MPU9250 = Part(
    kind="mpu9250",
    chip=Mpu9250Chip,
    odr_hz=100.0,
    range_g=2,
    units_per_g=16384,
    configured=(0x19, 0x1C, 0x6A),
    level_registers=(0x72, 0x73),
    other_odr_hz=200.0,
    other_range_g=4,
    code_limits=(-32768, 32767),
    registers={**REGISTERS, 0x1D: 3},
    has_gyro=True,
    resets_fifo=True,
)
MPU6050 = replace(MPU9250, kind="mpu6050", chip=Mpu6050Chip, registers=REGISTERS, has_self_test=False)
