"""An ADXL355 as its data sheet describes it (Rev. D, "Register map"), on the wires of `tests.devices.i2c.i2c_chip`."""

from dataclasses import replace
from typing import Any, ClassVar

from tests.devices.i2c.i2c_chip import FakeClock, I2cChip, Signal, level, to_counts
from tests.devices.i2c.part import Part

EMPTY_LOCATION = bytes([0, 0, 0b10])
POWER_ON = {
    0x00: 0xAD,
    0x01: 0x1D,
    0x02: 0xED,
    0x28: 0x00,
    0x29: 0x60,
    0x2A: 0x00,
    0x2B: 0x00,
    0x2C: 0x81,
    0x2D: 0x01,
    0x2E: 0x00,
}
STANDBY_ONLY = range(0x1E, 0x2D)  # offsets, activity, filter, FIFO, interrupts, synchronisation, range
LSB_PER_G = {1: 256000, 2: 128000, 3: 64000}


class Adxl355Chip(I2cChip):
    power_on: ClassVar = POWER_ON
    addresses = (0x1D, 0x53)
    fifo_places = 96
    places_per_sample = 3
    fifo_register = 0x11
    lsb_per_g: ClassVar = LSB_PER_G

    def __init__(
        self,
        clock: FakeClock,
        signal: Signal = level,
        *,
        revision: int = 0x01,
        busy_s: float = 0.003,
        refuses_while_busy: bool = False,
        **chip: Any,
    ) -> None:
        super().__init__(clock, signal, **chip)
        self.revision = revision
        self.busy_s = busy_s
        self.refuses_while_busy = refuses_while_busy
        self.temperature_raw = 1885
        self.temperature_steps: list[int] = []
        self.level_error = 0
        self._busy_until_ns = 0
        self._ready = self._overrun = False

    @property
    def odr_hz(self) -> float:
        return 4000.0 / (1 << min(self.registers[0x28] & 0x0F, 10)) * (1 + self.rate_error)

    @property
    def deflected(self) -> bool:
        return self.registers[0x2E] & 3 == 3

    @property
    def running(self) -> bool:
        return not self.registers[0x2D] & 1

    @property
    def busy(self) -> bool:
        return self.clock.now_ns() < self._busy_until_ns

    @property
    def refusing(self) -> bool:
        return self.refuses_while_busy and self.busy

    def brown_out(self) -> None:
        super().brown_out()
        self._ready = self._overrun = False

    def write_register(self, register: int, value: int) -> None:
        if register == 0x2F and value == 0x52:
            self.brown_out()
            self._busy_until_ns = self.clock.now_ns() + round(self.busy_s * 1e9)
        elif register in {0x2D, 0x2E} or (register in STANDBY_ONLY and not self.running):
            self.registers[register] = value

    def read_burst(self, length: int) -> bytes:
        if self._pointer == 0x11:
            return b"".join(self._pop() for _ in range(-(-length // 3)))[:length]
        return super().read_burst(length)

    def read_register(self, register: int) -> int:
        if register == 0x03:
            return self.revision
        if register == 0x04:
            full = len(self.fifo) >= self.registers[0x29]
            status = self._ready | full << 1 | self._overrun << 2
            self._ready = self._overrun = False
            return status
        if register == 0x05:
            return max(len(self.fifo) + self.level_error, 0)
        if register in (0x06, 0x07):
            raw = self.temperature_steps.pop(0) if self.temperature_steps else self.temperature_raw
            return raw >> 8 if register == 0x06 else raw & 0xFF
        return super().read_register(register)

    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        self._ready = True
        lsb_per_g = self.lsb_per_g[self.registers[0x2C] & 3]
        counts = [to_counts(axis_g, lsb_per_g, 20) for axis_g in force_g]
        return [(((count & 0xFFFFF) << 4) | (axis == 0)).to_bytes(3, "big") for axis, count in enumerate(counts)]

    def overrun(self) -> None:
        super().overrun()
        self._overrun = True

    def _pop(self) -> bytes:
        return self.fifo.popleft() if self.fifo else EMPTY_LOCATION


class Adxl357Chip(Adxl355Chip):
    """The same with larger ranges (ADXL356/ADXL357 Rev. C, Table 1)."""

    lsb_per_g: ClassVar = {1: 51200, 2: 25600, 3: 12800}


REGISTERS = {0x28: 0x05, 0x2C: 0x81, 0x2E: 0x00, 0x2D: 0x00}
ADXL355 = Part(
    kind="adxl355",
    chip=Adxl355Chip,
    odr_hz=125.0,
    range_g=2,
    units_per_g=256000,
    configured=(0x28, 0x2C, 0x2D),
    level_registers=(0x04, 0x05),
    other_odr_hz=125.0,
    other_range_g=4,
    code_limits=(-524288, 524287),
    registers=REGISTERS,
    commands=frozenset({0x2F}),
    temperature="fixed",
)
ADXL357 = replace(
    ADXL355, kind="adxl357", chip=Adxl357Chip, range_g=10, units_per_g=51200, other_range_g=20, has_self_test=False
)
